function displacement = springpot_full_memory(film, input, is_force, rate)
%SPRINGPOT_FULL_MEMORY  Eq. 11 as a sum over all of the past, in double precision.
%
%   displacement = springpot_full_memory(film, input, is_force, rate) is the displacement (m) of a film at rest at first, one row a step of
%   1/rate seconds. film is from springpot_film and has no curve; input is a column of voltages (V), or of forces with the weight (N) where
%   is_force is true.
%
%   It is independent of the controller's code, which compresses the memory: in the Gruenwald-Letnikov discretisation
%   F_k = sum over j of g_j dx_(k-j) + m rate^2 (dx_k - dx_(k-1)), solved for dx_k. The time that it takes grows with the square of the steps.

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
    electrostatic = film.actuator.force_per_square_volt * input.^2 ./ (1 + input.^2 * film.actuator.saturation_per_square_volt);
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
