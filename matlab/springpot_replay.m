function result = springpot_replay(parameters, recording, varargin)
%SPRINGPOT_REPLAY  A film's law along a recording, beside what was measured.
%
%   springpot_replay('film.toml', 'film-7s.csv') steps the law of film.toml along the voltage of a recording, prints R2 (Eq. 14),
%   NRMSE (% of peak to peak) and RMSE, and plots measured against modelled displacement.
%
%   result = springpot_replay(...) returns time_s, voltage_v (or force_n), displacement_m of the model, one row a step; measured_s,
%   measured_m and modelled_m, one row a measured value; r2, nrmse_pct, rmse_m, samples, rate_hz and law.
%
%   springpot_replay(..., 'law', LAW) steps by LAW:
%     'film_mex'  the MEX function of a film, which "host-sim export --params film.toml --emit sfunction --out film.c" wrote and
%                 "mex film_mex.c film.c" (MATLAB) or "mkoctfile --mex film_mex.c film.c" (Octave) built: what the controller runs.
%     'full'      this file's own sum over all of the past in double precision, at the recording's rate. It takes no film with an elastic
%                 curve, and at most 50000 steps.
%     By default it is NAME_mex of NAME.toml if that is on the path, otherwise 'full'.
%   springpot_replay(..., 'rate', HZ) sets the rate of 'full'.
%   springpot_replay(..., 'plot', FILE) writes the plot to a .png, .pdf or .svg, without a window; 'none' draws nothing.
%
%   The recording has a header line with time_s (or time_ms), voltage_v (or voltage_kv) or force_n, and displacement_m (or _mm, _um),
%   separated by commas. A measured value may be missing. Runs in MATLAB and Octave without toolboxes or packages.

  parameters = char(parameters);
  recording = char(recording);
  options = read_options(varargin);
  film = read_film(parameters);
  rows = read_recording(recording);
  law = options.law;
  if isempty(law)
    [~, name] = fileparts(parameters);
    law = [name '_mex'];
    if exist(law) ~= 3
      law = 'full';
    end
  end
  if strcmp(law, 'full')
    rate = options.rate;
    if isempty(rate)
      rate = whole(1 / median(diff(rows.time)));
    end
    if isfield(film, 'curve')
      fail('%s: it has a [curve], which ''full'' does not know; build its MEX function (help springpot_replay)', parameters);
    end
  else
    if ~isempty(options.rate)
      fail('rate: a MEX function has the rate that it was exported with; export with --rate');
    end
    if exist(law) ~= 3
      fail('%s: there is no such MEX function on the path; build it (help springpot_replay)', law);
    end
    numbers = feval(law);
    check_film(numbers, film, law, parameters);
    rate = whole(1 / numbers.step_s);
  end

  % The input on the grid of the law, linear between rows.
  steps = max(ceil(rows.time(end) * rate - 1e-6), 0) + 1;
  if strcmp(law, 'full') && steps > 50000
    fail('%s: %d steps at %g Hz; ''full'' takes at most 50000: lower the rate', recording, steps, rate);
  end
  time = (0:steps - 1)' / rate;
  input = resampled(rows.time, rows.input, time);
  if ~strcmp(law, 'full')
    if ~rows.is_force && any(abs(input) > numbers.max_voltage_v)
      fail('%s: %g V, but %s has a largest voltage of %g V', recording, max(abs(input)), law, numbers.max_voltage_v);
    end
    mode = 'film';
    if rows.is_force
      mode = 'displacement';
    end
    out = feval(law, mode, input);
    displacement = out.displacement_m;
  else
    displacement = full_memory(film, input, rows.is_force, rate);
  end

  % Compared at the measured times, as the sensor reads it.
  is_measured = ~isnan(rows.displacement);
  result.time_s = time;
  if rows.is_force
    result.force_n = input;
  else
    result.voltage_v = input;
  end
  result.displacement_m = displacement;
  result.measured_s = rows.time(is_measured);
  result.measured_m = rows.displacement(is_measured);
  result.modelled_m = at_times(displacement, rate, result.measured_s) + film.sensor.offset_m;
  result.samples = numel(result.measured_m);
  if result.samples < 2
    fail('%s: %d measured values; a comparison needs at least 2', recording, result.samples);
  end
  residual = result.measured_m - result.modelled_m;
  total = sum((result.measured_m - mean(result.measured_m)).^2);
  result.rmse_m = sqrt(mean(residual.^2));
  result.nrmse_pct = 100 * result.rmse_m / (max(result.measured_m) - min(result.measured_m));
  result.r2 = 1 - sum(residual.^2) / total;
  result.rate_hz = rate;
  result.law = law;
  fprintf('%s by %s at %g Hz: R2 %.5f, NRMSE %.3f %%, RMSE %.2f um, %d samples\n', ...
    recording, law, rate, result.r2, result.nrmse_pct, 1e6 * result.rmse_m, result.samples);
  if ~strcmp(options.plot, 'none')
    draw(result, film.name, recording, options.plot);
  end
end

function options = read_options(given)
  options = struct('law', '', 'rate', [], 'plot', '');
  if mod(numel(given), 2) ~= 0
    fail('options: they come in pairs of a name and a value: ''law'', ''rate'', ''plot''');
  end
  for k = 1:2:numel(given)
    name = char(given{k});
    if ~isfield(options, name)
      fail('%s: there is no such option; there are ''law'', ''rate'' and ''plot''', name);
    end
    if strcmp(name, 'rate')
      options.rate = given{k + 1};
      if ~(isnumeric(options.rate) && isscalar(options.rate) && isfinite(options.rate) && options.rate > 0)
        fail('rate: it must be a number of Hz above 0');
      end
    else
      options.(name) = char(given{k + 1});
    end
  end
end

function film = read_film(file)
%  The tables of a parameter file as host-sim writes it. Of [board] and [provenance] nothing is kept.
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

function rows = read_recording(file)
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
  rows.input = input;
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
    fail('%s: there is no such file', file);
  end
  text = strrep(fileread(file), char(13), '');
  lines = strtrim(cells_of(text, char(10)));
end

function cells = cells_of(text, separator)
%  Empty ones count.
  cells = strsplit(text, separator, 'CollapseDelimiters', false);
end

function check_film(numbers, film, law, parameters)
%  Whether the MEX function is of these parameters: its force, and without a curve its stiffness within one step.
  actuator = film.actuator;
  expected = [actuator.force_per_square_volt, actuator.stretch_coupling, 1 / actuator.saturation_v^2, actuator.preload_n];
  has = [numbers.force_per_square_volt, numbers.stretch_coupling, numbers.saturation_per_square_volt, numbers.preload_n];
  agrees = all(close(has, expected)) && numbers.has_curve == isfield(film, 'curve');
  if agrees && ~numbers.has_curve
    rate = whole(1 / numbers.step_s);
    % Of first order, and of second (--method bdf2).
    stiffnesses = [stiffness_of(film, rate), stiffness_of(film, 1.5 * rate)];
    agrees = any(close(numbers.stiffness_n_per_m, stiffnesses));
  end
  if ~agrees
    fail('%s: it was built of other numbers than %s has; export and build it again', law, parameters);
  end
end

function agrees = close(has, expected)
%  Single precision keeps seven digits.
  agrees = abs(has - expected) <= 1e-5 * abs(expected);
end

function stiffness = stiffness_of(film, rate)
%  Force per displacement within one step: Eq. 11 at s = rate, its mass included.
  pots = @(rows) rows(:, 1) .* rate.^rows(:, 2);
  stiffness = pots(film.model.main) + film.actuator.mass_kg * rate^2;
  soft = reshape(1 ./ pots(film.model.branches), 2, []);
  if ~isempty(soft) && strcmp(film.model.topology, 'eq11')
    stiffness = stiffness + size(soft, 2) / sum(soft(:));
  elseif ~isempty(soft)
    stiffness = stiffness + sum(1 ./ sum(soft, 1));
  end
end

function rate = whole(rate)
%  A rate without the rounding of single precision.
  if abs(rate - round(rate)) < 1e-6 * rate
    rate = round(rate);
  end
end

function value = resampled(time, value, now)
%  Linear between rows, constant after the last.
  before = interp1(time, (1:numel(time))', min(now, time(end)), 'previous');
  before = min(before, numel(time) - 1);
  share = (now - time(before)) ./ (time(before + 1) - time(before));
  last = value(end);
  value = value(before) + share .* (value(before + 1) - value(before));
  value(now >= time(end)) = last;
end

function value = at_times(series, rate, times)
  last = numel(series) - 1;
  place = min(max(times * rate, 0), last);
  before = min(floor(place), max(last - 1, 0));
  after = min(before + 1, last);
  value = series(before + 1) + (place - before) .* (series(after + 1) - series(before + 1));
end

function displacement = full_memory(film, input, is_force, rate)
%  Eq. 11 in the Gruenwald-Letnikov discretisation: F_k = sum over j of g_j dx_(k-j) + m rate^2 (dx_k - dx_(k-1)), solved for dx_k.
  steps = numel(input);
  impulse = [1; zeros(steps - 1, 1)];
  % Coefficients of ((1 - z) rate)^alpha.
  power = @(alpha) rate^alpha * cumprod([1; ((0:steps - 2)' - alpha) ./ (1:steps - 1)']);
  soft = @(pot) power(-pot(2)) / pot(1);
  modulus = film.model.main(1) * power(film.model.main(2));
  branches = film.model.branches;
  count = size(branches, 1) / 2;
  together = zeros(steps, 1);
  for k = 1:count
    branch = soft(branches(2 * k - 1, :)) + soft(branches(2 * k, :));
    if strcmp(film.model.topology, 'parallel')
      modulus = modulus + filter(1, branch, impulse);
    else
      together = together + branch;
    end
  end
  if count > 0 && strcmp(film.model.topology, 'eq11')
    modulus = modulus + count * filter(1, together, impulse);
  end
  relaxation = cumsum(modulus);
  past = flipud(relaxation);
  inertia = film.actuator.mass_kg * rate^2;
  force = input;
  slope = zeros(steps, 1);
  if ~is_force
    electrostatic = film.actuator.force_per_square_volt * input.^2 ./ (1 + (input / film.actuator.saturation_v).^2);
    force = electrostatic + film.actuator.preload_n;
    slope = electrostatic * film.actuator.stretch_coupling;
  end
  change = zeros(steps, 1);
  displacement = zeros(steps, 1);
  position = 0;
  before = 0;
  for k = 1:steps
    remembered = past(steps - k + 1:steps - 1)' * change(1:k - 1);
    before = (force(k) + slope(k) * position - remembered + inertia * before) / (relaxation(1) + inertia - slope(k));
    change(k) = before;
    position = position + before;
    displacement(k) = position;
  end
end

function draw(result, name, recording, file)
  if isempty(file)
    shown = figure();
  else
    shown = figure('visible', 'off');
  end
  subplot(2, 1, 1);
  plot(result.measured_s, 1e3 * result.measured_m, result.measured_s, 1e3 * result.modelled_m);
  legend('measured', 'modelled');
  ylabel('displacement (mm)');
  title(sprintf('%s along %s: R2 %.5f', name, recording, result.r2), 'interpreter', 'none');
  subplot(2, 1, 2);
  plot(result.measured_s, 1e6 * (result.measured_m - result.modelled_m));
  xlabel('time (s)');
  ylabel('measured - modelled (um)');
  if ~isempty(file)
    [~, ~, ending] = fileparts(file);
    if ~any(strcmp(ending, {'.png', '.pdf', '.svg'}))
      close(shown);
      fail('plot: %s ends neither in .png nor in .pdf nor in .svg', file);
    end
    print(shown, file, ['-d' ending(2:end)]);
    close(shown);
  end
end

function fail(varargin)
  error('springpot:replay', varargin{:});
end
