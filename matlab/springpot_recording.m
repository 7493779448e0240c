function rows = springpot_recording(file)
%SPRINGPOT_RECORDING  A recording of a film, in SI units.
%
%   rows = springpot_recording('film-7s.csv') returns columns: time (s), from 0; input (V, or N where is_force is true); displacement (m),
%   NaN where nothing was measured.
%
%   The file has a header line with time_s (or time_ms), voltage_v (or voltage_kv) or force_n, and displacement_m (or _mm, _um), separated
%   by commas; lines that begin with # are comments. "springpot import" makes such a file of others. What cannot be used is an error
%   'springpot:replay' that names file and line.

  file = char(file);
  lines = read_lines(file);
  numbers = 1:numel(lines);
  is_row = ~cellfun(@isempty, lines) & ~strncmp(lines, '#', 1);
  lines = lines(is_row);
  numbers = numbers(is_row);
  if numel(lines) < 3
    fail('%s: it needs a header and at least two rows', file);
  end
  header = strtrim(cells_of(lines{1}, ','));
  lines = lines(2:end);
  numbers = numbers(2:end);
  odd = find(cellfun(@(line) sum(line == ','), lines) ~= numel(header) - 1, 1);
  if ~isempty(odd)
    fail('%s, line %d: the header has %d columns, this line has not', file, numbers(odd), numel(header));
  end
  cells = strtrim(cells_of(strjoin(lines, ','), ','));
  is_empty = cellfun(@isempty, cells);
  values = nan(size(cells));
  values(~is_empty) = str2double(cells(~is_empty));
  wrong = find(~is_empty & ~isfinite(values), 1);
  if ~isempty(wrong)
    fail('%s, line %d: "%s" is not a number', file, numbers(ceil(wrong / numel(header))), cells{wrong});
  end
  values = reshape(values, numel(header), [])';
  time = column_of(values, header, {'time_s', 1; 'time_ms', 1e3});
  input = column_of(values, header, {'voltage_v', 1; 'voltage_kv', 1e-3});
  rows.is_force = isempty(input);
  if rows.is_force
    input = column_of(values, header, {'force_n', 1});
  end
  rows.displacement = column_of(values, header, {'displacement_m', 1; 'displacement_mm', 1e3; 'displacement_um', 1e6});
  if isempty(time) || isempty(input) || isempty(rows.displacement)
    fail('%s: it needs the columns time_s, voltage_v or force_n, and displacement_m', file);
  end
  missing = find(isnan(time) | isnan(input), 1);
  if ~isempty(missing)
    fail('%s, line %d: time and input must be there in every row', file, numbers(missing));
  end
  back = find(diff(time) <= 0, 1);
  if ~isempty(back)
    fail('%s, line %d: the time does not increase', file, numbers(back + 1));
  end
  rows.time = time - time(1);
  % A held load whose clock begins a little after 0: it was applied at 0.
  held = is_held(input) || (rows.is_force && is_held(rows.displacement(~isnan(rows.displacement))));
  if held && time(1) > 0 && time(1) <= 0.01 * rows.time(end)
    rows.time = time;
  end
  rows.input = input;
end

function is = is_held(values)
%  Whether a load stays within 1 % of the first.
  is = ~isempty(values) && values(1) ~= 0 && all(abs(values - values(1)) <= 0.01 * abs(values(1)));
end

function column = column_of(values, header, names)
%  The column of one of the names, in SI units; empty without one.
  column = [];
  for k = 1:size(names, 1)
    at = find(strcmpi(header, names{k, 1}), 1);
    if ~isempty(at)
      column = values(:, at) / names{k, 2};
      return
    end
  end
end

function lines = read_lines(file)
  if exist(file, 'file') ~= 2
    fail('%s: no such file', file);
  end
  text = strrep(fileread(file), char(13), '');
  lines = strtrim(cells_of(text, char(10)));
end

function cells = cells_of(text, separator)
%  Empty ones count.
  cells = strsplit(text, separator, 'CollapseDelimiters', false);
end

function fail(varargin)
  error('springpot:replay', varargin{:});
end
