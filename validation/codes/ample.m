% Cases in files by AMPLE (W. M. Coombs and C. E. Augarde, Adv. Eng. Softw. 139 (2020) 102748), a copy of the user's own:
% octave-cli ample.m FOLDER mpm|gimp CASE ANSWER, FOLDER holding its `functions` and `constitutive`.
%
% Its routines are called as they are. An analysis is the first Newton step from rest, K(0) u = f, which is small strain;
% stress is that of displacements of 1e-5 cells both ways, half their difference, which leaves 1e-10 of finite strain.
% Load steps are those of its main script.
1;

function mesh = grid_of(said, held)
  h = said.grid.h(:)'; cells = said.grid.cells(:)';
  [etpl, coord] = formCoord2D(cells(1), cells(2), cells(1) * h(1), cells(2) * h(2));
  coord += said.grid.origin(:)';
  mesh = struct('etpl', etpl, 'coord', coord, 'h', h);
  for i = 1:2
    c = coord(:, i)(etpl); mesh.eMin(:, i) = min(c, [], 2); mesh.eMax(:, i) = max(c, [], 2);
  end
  node = held(:, 2) * (cells(1) + 1) + held(:, 1) + 1; mesh.bc = zeros(0, 2);
  for i = 1:2
    on = held(:, 4 + i) == 1; mesh.bc = [mesh.bc; 2 * (node(on) - 1) + i, held(on, 6 + i)];
  end
end

function mpData = points_of(points, nu, gimp)
  for p = rows(points):-1:1
    lp = points(p, 5:6) * gimp; V = points(p, 4);
    mpData(p) = struct('mpType', 1 + gimp, 'cmType', 1, 'mpC', points(p, 2:3), 'vp', V, 'vp0', V, 'mpM', 0, ...
      'nIN', zeros(4, 1), 'eIN', 0, 'Svp', zeros(1, 4), 'dSvp', zeros(2, 4), 'Fn', eye(3), 'F', eye(3), ...
      'sig', zeros(6, 1), 'epsEn', zeros(6, 1), 'epsE', zeros(6, 1), 'mCst', [points(p, 7), nu, 1], ...
      'fp', points(p, 8:9)', 'u', zeros(2, 1), 'lp', lp, 'lp0', lp, 'nSMe', 0);
  end
end

function row = statics(mesh, mpData, points)
  [mesh, mpData] = elemMPinfo(mesh, mpData);
  f = detExtForce(rows(mesh.coord), 2, 0, mpData);
  [~, K, mpData] = detMPs(zeros(size(f)), mpData);
  u = linSolve(mesh.bc, K, f, 1, detFDoFs(mesh));
  small = 1e-5 * min(mesh.h) / max(abs(u));
  [~, ~, there] = detMPs(small * u, mpData); [~, ~, back] = detMPs(-small * u, mpData);
  for p = rows(points):-1:1
    stress = (there(p).sig - back(p).sig)([1 2 4])' / (2 * small);
    row(p, :) = [p - 1, points(p, 2:3), mpData(p).Svp * reshape(u, 2, [])'(mpData(p).nIN, :), stress];
  end
end

function row = load_steps(mesh, mpData, count)
  row = zeros(0, 7);
  for step = 1:count
    [mesh, mpData] = elemMPinfo(mesh, mpData); fd = detFDoFs(mesh);
    f = detExtForce(rows(mesh.coord), 2, 0, mpData) * step / count;
    u = zeros(size(f)); reaction = u; oobf = f; K = sparse(rows(f), rows(f)); it = 0; err = 1; before = Inf;
    % to 1e-12, or until rounding lets the residual fall no more
    while it < 2 || (err > 1e-12 && (err < before / 2 || err > 1e-6))
      if it == 20
        error('no equilibrium in step %d: residual %.1e after 20 iterations', step, err);
      end
      [du, dr] = linSolve(mesh.bc, K, oobf, it, fd);
      u += du; reaction += dr;
      [inner, K, mpData] = detMPs(u, mpData);
      oobf = f - inner + reaction; before = err; err = norm(oobf) / norm(f + reaction + eps); it++;
    end
    mpData = updateMPs(u, mpData);
    p = numel(mpData); sig = reshape([mpData.sig], 6, p)';
    row = [row; repmat(step, p, 1), (0:p - 1)', reshape([mpData.mpC], 2, p)', sig(:, [1 2 4])];
  end
end

args = argv(); [home, kind, where, answer] = args{:};
addpath(fullfile(home, 'functions'), fullfile(home, 'constitutive'), fullfile(home, 'setup'));
out = fopen(answer, 'w');
if strcmp(where, 'capabilities')
  can = {'analysis', 'load steps', 'quadrature at points', 'moduli by point', 'body forces', ...
         'prescribed displacements', 'any outline', 'points anywhere'};
  said = struct('name', ['AMPLE, ' kind], 'version', '1.1', 'capabilities', {can}, 'accuracy', 1e-7);
  fprintf(out, '%s', jsonencode(said)); fclose(out); exit(0);
end
table = @(name) dlmread(fullfile(where, name), ',', 1, 0);
said = jsondecode(fileread(fullfile(where, 'case.json'))); points = table('points.csv');
mesh = grid_of(said, table('held.csv'));
mpData = points_of(points, said.material.poisson, strcmp(kind, 'gimp'));
try
  if strcmp(said.kind, 'load steps')
    fprintf(out, 'step,point,x,y,sxx,syy,sxy\n');
    fprintf(out, '%d,%d,%.17g,%.17g,%.17g,%.17g,%.17g\n', load_steps(mesh, mpData, said.steps)');
  else
    fprintf(out, 'point,x,y,ux,uy,sxx,syy,sxy\n');
    fprintf(out, '%d,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n', statics(mesh, mpData, points)');
  end
  fclose(out);
catch met
  fprintf(stderr, '%s, line %d: %s\n', met.stack(1).name, met.stack(1).line, met.message); exit(1);
end
