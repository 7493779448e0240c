function film = springpot_film(file)
%SPRINGPOT_FILM  The parameters of a film, of a file that host-sim has written.
%
%   film = springpot_film('film.toml') returns name, and as structures actuator, model (topology; main and branches as rows of c in
%   N s^alpha/m and alpha, two rows a branch) and sensor, in SI units. actuator has what Eq. 1 makes of it as well:
%   force_per_square_volt (N/V^2) and preload_n. [curve] is there, not its arrays; [board] and [provenance] are left out. What cannot be
%   used is an error 'springpot:replay' that names file and line.

  file = char(file);
  film = struct('name', '', 'sensor', struct('offset_m', 0));
  lines = read_lines(file);
  table = '';
  number = 0;
  while number < numel(lines)
    number = number + 1;
    first = number;
    line = without_comment(lines{number});
    if isempty(line)
      continue
    end
    if line(1) == '['
      table = line(2:find(line == ']', 1) - 1);
      if any(strcmp(table, {'actuator', 'model', 'curve'}))
        film.(table) = struct();
      end
      continue
    end
    equals = find(line == '=', 1);
    if isempty(equals)
      fail('%s, line %d: neither a table nor key = value', file, first);
    end
    key = strtrim(line(1:equals - 1));
    value = strtrim(line(equals + 1:end));
    while ~strncmp(value, '"', 1) && sum(value == '[') > sum(value == ']') && number < numel(lines)
      number = number + 1;
      value = [value ' ' without_comment(lines{number})]; %#ok<AGROW>
    end
    if isempty(table) && strcmp(key, 'name')
      film.name = unquoted(value);
    elseif any(strcmp(table, {'actuator', 'model', 'curve', 'sensor'})) && isvarname(key)
      film.(table).(key) = read_value(value, file, first, key);
    end
  end
  needs = {'actuator', {'relative_permittivity', 'length_m', 'width_m', 'thickness_m', 'mass_kg'}; ...
    'model', {'topology', 'main', 'branches'}};
  for k = 1:2
    for key = needs{k, 2}
      if ~(isfield(film, needs{k, 1}) && isfield(film.(needs{k, 1}), key{1}))
        fail('%s: [%s] %s is missing; it must be a parameter file of host-sim', file, needs{k, 1}, key{1});
      end
    end
  end
  film.actuator = with_defaults(film.actuator);
  if size(film.model.main, 1) ~= 1 || mod(size(film.model.branches, 1), 2) ~= 0
    fail('%s: [model] has one springpot as main and two in each branch', file);
  end
  if ~any(strcmp(film.model.topology, {'eq11', 'parallel'}))
    fail('%s: topology "%s" is neither "eq11" nor "parallel"', file, film.model.topology);
  end
end

function value = read_value(text, file, line, key)
%  A number, a text, or springpots as rows of c and alpha.
  if any(strcmp(key, {'main', 'branches'}))
    pots = regexp(text, '\{[^}]*\}', 'match');
    value = zeros(numel(pots), 2);
    names = {'c', 'alpha'};
    for k = 1:numel(pots)
      for column = 1:2
        found = regexp(pots{k}, ['[{,\s]' names{column} '\s*=\s*([^,}\s]+)'], 'tokens', 'once');
        if isempty(found)
          fail('%s, line %d: a springpot needs c and alpha', file, line);
        end
        value(k, column) = str2double(strrep(found{1}, '_', ''));
      end
    end
  elseif ~isempty(text) && text(1) == '"'
    value = unquoted(text);
    return
  elseif ~isempty(text) && text(1) == '['
    value = text; % an array of a curve, which is not used here
    return
  else
    value = str2double(strrep(text, '_', ''));
  end
  if any(isnan(value(:)))
    fail('%s, line %d: %s is not a number', file, line, key);
  end
end

function actuator = with_defaults(actuator)
  defaults = {'preload', 'settled'; 'stretch_coupling', 0; 'saturation_v', Inf};
  for k = 1:size(defaults, 1)
    if ~isfield(actuator, defaults{k, 1})
      actuator.(defaults{k, 1}) = defaults{k, 2};
    end
  end
  actuator.force_per_square_volt = 8.8541878128e-12 * actuator.relative_permittivity ...
    * actuator.length_m * actuator.width_m / actuator.thickness_m^2;
  actuator.preload_n = 0;
  if strcmp(actuator.preload, 'from-start')
    actuator.preload_n = 9.80665 * actuator.mass_kg;
  end
end

function line = without_comment(line)
  quotes = cumsum(line == '"');
  comment = find(line == '#' & mod(quotes, 2) == 0, 1);
  if ~isempty(comment)
    line = line(1:comment - 1);
  end
  line = strtrim(line);
end

function text = unquoted(text)
  text = strrep(text(2:end - 1), '\"', '"');
end

function lines = read_lines(file)
  if exist(file, 'file') ~= 2
    fail('%s: there is no such file', file);
  end
  text = strrep(fileread(file), char(13), '');
  lines = strtrim(strsplit(text, char(10), 'CollapseDelimiters', false));
end

function fail(varargin)
  error('springpot:replay', varargin{:});
end
