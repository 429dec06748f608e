% A small material point method for the file route: tents, plane strain or stress, one linear solve.
% octave toy_mpm.m CASE ANSWER
args = argv(); where = args{1}; answer = args{2};
if strcmp(where, 'capabilities')
  can = {'analysis', 'quadrature at points', 'moduli by point', 'body forces', 'prescribed displacements', ...
         'plane stress', 'any outline', 'points anywhere'};
  out = fopen(answer, 'w');
  fprintf(out, '%s', jsonencode(struct('name', 'toy MPM', 'version', '1', 'capabilities', {can})));
  fclose(out); exit(0);
end
table = @(name) dlmread(fullfile(where, name), ',', 1, 0);
said = jsondecode(fileread(fullfile(where, 'case.json')));
points = table('points.csv'); held = table('held.csv');
x = points(:, 2:3); V = points(:, 4); E = points(:, 7); force = points(:, 8:9); p = rows(x);
h = said.grid.h(:)'; cells = said.grid.cells(:)'; ny = cells(2) + 1;

% cell of each point, half-open, and its four nodes with weights and gradients
xi = (x - said.grid.origin(:)') ./ h; cell = floor(xi + 1e-12); s = xi - cell;
node = zeros(p, 4); N = zeros(p, 4); dx = N; dy = N; k = 0;
for a = 0:1
  for b = 0:1
    k++;
    wx = a * s(:, 1) + (1 - a) * (1 - s(:, 1)); wy = b * s(:, 2) + (1 - b) * (1 - s(:, 2));
    node(:, k) = (cell(:, 1) + a) * ny + cell(:, 2) + b + 1;
    N(:, k) = wx .* wy; dx(:, k) = (2 * a - 1) / h(1) * wy; dy(:, k) = wx * (2 * b - 1) / h(2);
  end
end

% B, rows xx, yy, xy of each point
total = 2 * prod(cells + 1); at = (1:p)';
row = [3 * at - 2; 3 * at - 1; 3 * at; 3 * at];
B = sparse(3 * p, total); W = sparse(p, total / 2);
for k = 1:4
  ux = 2 * node(:, k) - 1; uy = 2 * node(:, k);
  B += sparse(row, [ux; uy; ux; uy], [dx(:, k); dy(:, k); dy(:, k); dx(:, k)], 3 * p, total);
  W += sparse(at, node(:, k), N(:, k), p, total / 2);
end

nu = said.material.poisson;
if strcmp(said.material.plane, 'stress')
  D = [1, nu, 0; nu, 1, 0; 0, 0, (1 - nu) / 2] / (1 - nu^2);
else
  D = [1 - nu, nu, 0; nu, 1 - nu, 0; 0, 0, 0.5 - nu] / (1 + nu) / (1 - 2 * nu);
end
K = B' * kron(spdiags(E .* V, 0, p, p), D) * B;
f = reshape((W' * force)', [], 1);

% held nodes, and those that no point touches by weight or gradient, leave the system
u = zeros(total, 1); index = held(:, 1) * ny + held(:, 2) + 1; fixed = false(total, 1);
for c = 1:2
  dof = 2 * (index - 1) + c; on = held(:, 4 + c) == 1;
  fixed(dof(on)) = true; u(dof(on)) = held(on, 6 + c);
end
touched = full(any(B, 1))';
u(~touched) = 0; free = touched & ~fixed;
u(free) = K(free, free) \ (f(free) - K(free, ~free) * u(~free));

up = W * reshape(u, 2, [])'; stress = (E .* (reshape(B * u, 3, [])' * D));
out = fopen(answer, 'w');
fprintf(out, 'point,x,y,ux,uy,sxx,syy,sxy\n');
fprintf(out, '%d,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n', [at - 1, x, up, stress]');
fclose(out);
