function result = springpot_replay(parameters, recording, varargin)
%SPRINGPOT_REPLAY  A film's law along a recording, beside what was measured.
%
%   springpot_replay('film.json', 'film-7s.csv') steps the law of film.json along the voltage of a recording, prints R2 (Eq. 14),
%   NRMSE (% of peak to peak) and RMSE, and plots measured against modelled displacement. "springpot export --params film.toml --emit
%   sfunction --out film.c" writes film.json, film_mex.c and film.c.
%
%   result = springpot_replay(...) returns time_s, voltage_v (or force_n), displacement_m of the model, one row a step; measured_s,
%   measured_m and modelled_m, one row a measured value; r2, nrmse_pct, rmse_m, samples, rate_hz and law.
%
%   springpot_replay(..., 'law', LAW) steps by LAW:
%     'film_mex'  the MEX function of the film, built by "mex film_mex.c film.c" (MATLAB) or "mkoctfile --mex film_mex.c film.c" (Octave):
%                 what the controller runs.
%     'full'      springpot_full_memory: a sum over all of the past in double precision, at the recording's rate. It takes no film with an
%                 elastic curve, and at most 50000 steps.
%     By default it is NAME_mex of NAME.json if that is on the path, otherwise 'full'.
%   springpot_replay(..., 'rate', HZ) sets the rate of 'full'.
%   springpot_replay(..., 'plot', FILE) writes the plot to a .png, .pdf or .svg, without a window; 'none' draws nothing.
%
%   help springpot_recording describes recordings, help springpot_film the .json. Runs in MATLAB and Octave 7 or later without toolboxes
%   or packages.

  parameters = char(parameters);
  recording = char(recording);
  options = read_options(varargin);
  film = springpot_film(parameters);
  rows = springpot_recording(recording);
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
      rate = 1 / median(diff(rows.time));
      if abs(rate - round(rate)) < 1e-6 * rate
        rate = round(rate);
      end
    end
    if film.model.has_curve
      fail('%s: it has a curve, which ''full'' does not know; build its MEX function (help springpot_replay)', parameters);
    end
  else
    if ~isempty(options.rate)
      fail('rate: a MEX function has the rate that it was exported with; export with --rate');
    end
    if exist(law) ~= 3
      fail('%s: no such MEX function on the path; build it (help springpot_replay)', law);
    end
    numbers = feval(law);
    check_film(numbers, film, law, parameters);
    rate = film.law.rate_hz;
  end

  % The input on the grid of the law, linear between rows.
  steps = max(ceil(rows.time(end) * rate - 1e-6), 0) + 1;
  if strcmp(law, 'full') && steps > 50000
    fail('%s: %d steps at %g Hz; ''full'' takes at most 50000: lower the rate', recording, steps, rate);
  end
  time = (0:steps - 1)' / rate;
  input = resampled(rows.time, rows.input, time);
  if ~strcmp(law, 'full')
    mode = 'displacement';
    if ~rows.is_force
      mode = 'film';
      check_voltage(input, numbers.max_voltage_v, law, recording);
    end
    out = feval(law, mode, input);
    displacement = out.displacement_m;
  else
    displacement = springpot_full_memory(film, input, rows.is_force, rate);
  end

  if ~all(isfinite(displacement))
    fail('%s: the displacement grows without bound: the film of %s is pulled in', recording, parameters);
  end

  % Compared at the measured times, as the sensor reads it.
  is_measured = ~isnan(rows.displacement);
  found.time_s = time;
  if rows.is_force
    found.force_n = input;
  else
    found.voltage_v = input;
  end
  found.displacement_m = displacement;
  found.measured_s = rows.time(is_measured);
  found.measured_m = rows.displacement(is_measured);
  found.modelled_m = at_times(displacement, rate, found.measured_s) + film.sensor.offset_m;
  found.samples = numel(found.measured_m);
  if found.samples < 2
    fail('%s: %d measured values; a comparison needs at least 2', recording, found.samples);
  end
  residual = found.measured_m - found.modelled_m;
  total = sum((found.measured_m - mean(found.measured_m)).^2);
  found.rmse_m = sqrt(mean(residual.^2));
  found.nrmse_pct = 100 * found.rmse_m / (max(found.measured_m) - min(found.measured_m));
  found.r2 = 1 - sum(residual.^2) / total;
  found.rate_hz = rate;
  found.law = law;
  fprintf('%s by %s at %g Hz: R2 %.5f, NRMSE %.3f %%, RMSE %.2f um, %d samples\n', ...
    recording, law, rate, found.r2, found.nrmse_pct, 1e6 * found.rmse_m, found.samples);
  if ~strcmp(options.plot, 'none')
    draw(found, film.name, recording, options.plot);
  end
  if nargout > 0
    result = found;
  end
end

function options = read_options(given)
  options = struct('law', '', 'rate', [], 'plot', '');
  if mod(numel(given), 2) ~= 0
    fail('options: give pairs of a name and a value: ''law'', ''rate'', ''plot''');
  end
  for k = 1:2:numel(given)
    name = char(given{k});
    if ~isfield(options, name)
      fail('%s: not an option; the options are ''law'', ''rate'' and ''plot''', name);
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
  [~, ~, ending] = fileparts(options.plot);
  if ~any(strcmp(options.plot, {'', 'none'})) && ~any(strcmp(ending, {'.png', '.pdf', '.svg'}))
    fail('plot: %s ends neither in .png nor in .pdf nor in .svg', options.plot);
  end
end

function check_film(numbers, film, law, parameters)
%  Refuses a MEX function of other parameters: by the numbers of its force, its step, its stiffness within one step and its curve.
  names = {'force_per_square_volt', 'stretch_coupling', 'saturation_per_square_volt', 'preload_n'};
  expected = [cellfun(@(name) film.actuator.(name), names), 1 / film.law.rate_hz, film.law.stiffness_n_per_m, film.model.has_curve];
  has = cellfun(@(name) double(numbers.(name)), [names, {'step_s', 'stiffness_n_per_m', 'has_curve'}]);
  % Single precision keeps seven digits.
  if any(abs(has - expected) > 1e-5 * abs(expected))
    fail('%s: it was built of other numbers than %s has; export and build it again', law, parameters);
  end
end

function check_voltage(voltage, largest, law, recording)
%  The film's code takes larger voltages as the largest, so little may be above: the noise of a monitor.
  highest = max(abs(voltage));
  if highest > 1.01 * largest
    fail('%s: %g V, but %s takes at most %g V; export it with a larger [board.limits] max_voltage_v', recording, highest, law, largest);
  elseif highest > largest
    fprintf('%s: %d steps above %g V, up to %g V, count as %g V, the [board.limits] max_voltage_v of %s\n', recording, ...
      sum(abs(voltage) > largest), largest, highest, largest, law);
  end
end

function value = resampled(time, value, now)
%  Linear between rows, constant before the first and after the last.
  now = max(now, time(1));
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

function draw(result, name, recording, file)
  if isempty(file)
    shown = figure();
  else
    shown = figure('visible', 'off');
  end
  subplot(2, 1, 1);
  plot(result.measured_s, 1e3 * result.measured_m, 'color', [0.55 0.75 0.95], 'linewidth', 3);
  hold('on');
  plot(result.measured_s, 1e3 * result.modelled_m, 'color', [0.8 0.3 0.1], 'linewidth', 1);
  hold('off');
  xlim(result.measured_s([1 end]));
  % Above the lines is room for the legend.
  both = 1e3 * [result.measured_m; result.modelled_m];
  ylim(min(both) + max(max(both) - min(both), 1e-6) * [-0.05 1.4]);
  legend({'measured', 'modelled'}, 'location', 'northeast', 'orientation', 'horizontal');
  ylabel('displacement (mm)');
  title(sprintf('%s along %s: R2 %.5f', name, recording, result.r2), 'interpreter', 'none');
  subplot(2, 1, 2);
  plot(result.measured_s, 1e6 * (result.measured_m - result.modelled_m));
  xlim(result.measured_s([1 end]));
  xlabel('time (s)');
  ylabel('measured - modelled (um)');
  if ~isempty(file)
    [~, ~, ending] = fileparts(file);
    print(shown, file, ['-d' ending(2:end)]);
    close(shown);
  end
end

function fail(varargin)
  error('springpot:replay', varargin{:});
end
