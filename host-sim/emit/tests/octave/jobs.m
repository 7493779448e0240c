% Steps the films of jobs.txt: lines of a MEX function, a mode, a file of inputs and a file for outputs. Numbers are single precision.
inputs = struct('displacement', 'force_n', 'force', 'displacement_m', 'film', 'voltage_v', ...
  'feedforward', 'reference_m', 'observer', 'voltage_v', 'tracking', 'reference_m', ...
  'adaptive', 'reference_m');
jobs = strsplit(strtrim(fileread('jobs.txt')), char(10));
for k = 1:numel(jobs)
  words = strsplit(jobs{k}, ' ');
  [law, mode] = words{1:2};
  file = fopen(words{3}, 'r', 'ieee-le');
  rows = fread(file, [5 Inf], 'single=>single')';
  fclose(file);
  given = struct(inputs.(mode), rows(:, 1));
  if any(strcmp(mode, {'observer', 'tracking', 'adaptive'}))
    given.sample_m = rows(:, 2);
    given.age_ticks = 10;
  end
  if any(strcmp(mode, {'feedforward', 'tracking', 'adaptive'}))
    given.applied_v = rows(:, 4);
    given.reading_v = rows(:, 5);
    if any(rows(:, 3) > 0)
      given.temperature_c = rows(:, 3);
    end
  end
  % In pieces: one tick, a third as rows of double, the rest as columns of single; the state goes on.
  steps = size(rows, 1);
  ends = [1, floor(steps / 3), steps];
  written = zeros(steps, 7);
  first = 1;
  for piece = 1:3
    part = structfun(@(column) column(min(first, end):min(ends(piece), end)), given, 'UniformOutput', false);
    if piece == 2
      part = structfun(@(column) double(column)', part, 'UniformOutput', false);
    end
    if piece == 1
      [out, state] = feval(law, mode, part);
    elseif numel(fieldnames(part)) == 1
      [out, state] = feval(law, mode, part.(inputs.(mode)), state);
    else
      [out, state] = feval(law, mode, part, state);
    end
    written(first:ends(piece), :) = [out.displacement_m, out.voltage_v, out.force_n, out.reference_m, ...
      out.disturbance_n, out.force_scale, out.limited];
    first = ends(piece) + 1;
  end
  file = fopen(words{4}, 'w', 'ieee-le');
  fwrite(file, single(written)', 'single');
  fclose(file);
end
