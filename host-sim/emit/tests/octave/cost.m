% What calls of film_mex cost on this machine: the best of seven runs each. Run it in the folder of a film_mex that was built of
% "springpot export --params preset:table3-n2 --emit sfunction --out film.c".
1;
function best(what, calls, run)
  seconds = Inf;
  for k = 1:7
    begun = tic();
    run();
    seconds = min(seconds, toc(begun));
  end
  printf('%-38s %9.3f us\n', what, 1e6 * seconds / calls);
end
function one_by_one(mode, in, calls)
  [~, state] = film_mex(mode, in);
  for k = 1:calls
    [out, state] = film_mex(mode, in, state);
  end
end
t = (0:154999)' / 1000;
followed = struct('reference_m', 1e-3 - 1e-4 * cos(t), 'sample_m', 1e-3 - 1e-4 * cos(t));
tick = struct('reference_m', 1e-3, 'sample_m', 1e-3);
best('a step of the law, along an array', 155000, @() film_mex('displacement', 20 + 10 * sin(t)));
best('a step of the film, along an array', 155000, @() film_mex('film', 3000 * (1 - cos(t))));
best('a tick of tracking, along an array', 155000, @() film_mex('tracking', followed));
best('a step of the law, one by one', 10000, @() one_by_one('displacement', 20, 10000));
best('a tick of tracking, one by one', 10000, @() one_by_one('tracking', tick, 10000));
