function film = springpot_film(file)
%SPRINGPOT_FILM  The film that "springpot export" describes in JSON.
%
%   film = springpot_film('film.json') returns structures in SI units: actuator (size, mass, and what Eq. 1 makes of them:
%   force_per_square_volt in N/V^2, saturation_per_square_volt in 1/V^2, preload_n), model (topology; main and branches as rows of c in
%   N s^alpha/m and alpha, two rows a branch; has_curve), sensor and law (rate_hz, stiffness_n_per_m), beside name.
%
%   "springpot export --params film.toml --emit sfunction --out film.c" (or --emit c) writes film.json beside film.c. A file that cannot be
%   used is an error 'springpot:replay' that names it.

  file = char(file);
  if exist(file, 'file') ~= 2
    error('springpot:replay', '%s: no such file', file);
  end
  try
    film = jsondecode(fileread(file));
  catch
    film = [];
  end
  if ~(isstruct(film) && isfield(film, 'format') && strcmp(film.format, 'springpot-film'))
    error('springpot:replay', '%s: not a film; give the .json that "springpot export --emit sfunction" writes beside the .c', file);
  end
  if film.schema ~= 1
    error('springpot:replay', '%s: schema %g is not known; use the scripts of the same release as host-sim', file, film.schema);
  end
  film.model.main = film.model.main(:)';
end
