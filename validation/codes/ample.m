% Cases in files by AMPLE (W. M. Coombs and C. E. Augarde, Adv. Eng. Softw. 139 (2020) 102748), a copy of the user's own:
% octave-cli ample.m FOLDER mpm|gimp CASE ANSWER, FOLDER holding its `functions` and `constitutive`.
%
% Its routines are called as they are. The first Newton step from rest, K(0) u = f, is small strain; stress is that of
% displacements of 1e-5 cells both ways, half their difference, which leaves 1e-10 of finite strain.
args = argv(); [home, kind, where, answer] = args{:};
addpath(fullfile(home, 'functions'), fullfile(home, 'constitutive'), fullfile(home, 'setup'));
if strcmp(where, 'capabilities')
  can = {'analysis', 'quadrature at points', 'moduli by point', 'body forces', 'prescribed displacements', ...
         'any outline', 'points anywhere'};
  said = struct('name', ['AMPLE, ' kind], 'version', '1.1', 'capabilities', {can}, 'accuracy', 1e-7);
  out = fopen(answer, 'w'); fprintf(out, '%s', jsonencode(said)); fclose(out); exit(0);
end
table = @(name) dlmread(fullfile(where, name), ',', 1, 0);
said = jsondecode(fileread(fullfile(where, 'case.json')));
points = table('points.csv'); held = table('held.csv');
h = said.grid.h(:)'; cells = said.grid.cells(:)'; nu = said.material.poisson; gimp = strcmp(kind, 'gimp');

[etpl, coord] = formCoord2D(cells(1), cells(2), cells(1) * h(1), cells(2) * h(2));
coord += said.grid.origin(:)';
mesh = struct('etpl', etpl, 'coord', coord, 'h', h);
for i = 1:2
  c = coord(:, i)(etpl); mesh.eMin(:, i) = min(c, [], 2); mesh.eMax(:, i) = max(c, [], 2);
end
node = held(:, 2) * (cells(1) + 1) + held(:, 1) + 1; bc = zeros(0, 2);
for i = 1:2
  on = held(:, 4 + i) == 1; bc = [bc; 2 * (node(on) - 1) + i, held(on, 6 + i)];
end
mesh.bc = bc;

for p = rows(points):-1:1
  lp = points(p, 5:6) * gimp; V = points(p, 4);
  mpData(p) = struct('mpType', 1 + gimp, 'cmType', 1, 'mpC', points(p, 2:3), 'vp', V, 'vp0', V, 'mpM', 0, ...
    'nIN', zeros(4, 1), 'eIN', 0, 'Svp', zeros(1, 4), 'dSvp', zeros(2, 4), 'Fn', eye(3), 'F', eye(3), ...
    'sig', zeros(6, 1), 'epsEn', zeros(6, 1), 'epsE', zeros(6, 1), 'mCst', [points(p, 7), nu, 1], ...
    'fp', points(p, 8:9)', 'u', zeros(2, 1), 'lp', lp, 'lp0', lp, 'nSMe', 0);
end
[mesh, mpData] = elemMPinfo(mesh, mpData);
f = detExtForce(rows(coord), 2, 0, mpData);
[~, K, mpData] = detMPs(zeros(size(f)), mpData);
u = linSolve(mesh.bc, K, f, 1, detFDoFs(mesh));

small = 1e-5 * min(h) / max(abs(u));
[~, ~, there] = detMPs(small * u, mpData); [~, ~, back] = detMPs(-small * u, mpData);
out = fopen(answer, 'w');
fprintf(out, 'point,x,y,ux,uy,sxx,syy,sxy\n');
for p = 1:rows(points)
  stress = (there(p).sig - back(p).sig)([1 2 4]) / (2 * small);
  up = mpData(p).Svp * reshape(u, 2, [])'(mpData(p).nIN, :);
  fprintf(out, '%d,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n', p - 1, points(p, 2:3), up, stress);
end
fclose(out);
