// Snapping of points on the plan. Pure functions; metres in the site's frame.
//
// In order of preference: a corner that the drawing must meet; a straight line along an axis from the previous point; an
// end of a wall or a corner of a room; the centre line of a wall, on the grid along it; the grid.

export const GRID_M = 0.05;
const REACH_M = 0.15;
const WALL_SHARE = 0.7; // of the reach, so that an end wins against the line of a wall
const STRAIGHT = 0.06; // of the length, 3.4 degrees
const EXACT_M = 1e-9;

export const rounded = (value, step = 0.001) => Math.round(Math.round(value / step) * step * 10000) / 10000;
export const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
const at = (point) => point.map((each) => rounded(each));

export function nearestOn(start, end, point) {
  const way = [end[0] - start[0], end[1] - start[1]];
  const square = way[0] ** 2 + way[1] ** 2 || 1;
  const share = Math.min(1, Math.max(0, ((point[0] - start[0]) * way[0] + (point[1] - start[1]) * way[1]) / square));
  return [start[0] + share * way[0], start[1] + share * way[1]];
}

function nearest(points, point, reach) {
  let best = null;
  let away = reach;
  for (const other of points) {
    const off = distance(point, other);
    if (off < away) [best, away] = [other, off];
  }
  return best;
}

// Snaps a distance from a wall's start: to the plan's grid if the wall is parallel to an axis, else to its own grid.
export function gridAlong(wall, far) {
  const whole = distance(wall.start, wall.end);
  const axis = [0, 1].find((each) => Math.abs(wall.end[1 - each] - wall.start[1 - each]) < EXACT_M);
  let on = rounded(far, GRID_M);
  if (axis !== undefined && whole > 0) {
    const forward = Math.sign(wall.end[axis] - wall.start[axis]);
    on = (rounded(wall.start[axis] + forward * far, GRID_M) - wall.start[axis]) * forward;
  }
  return Math.min(Math.max(on, 0), whole);
}

// Point on a wall's centre line at a distance from its start.
export function along(wall, far) {
  const whole = distance(wall.start, wall.end) || 1;
  return [0, 1].map((axis) => rounded(wall.start[axis] + ((wall.end[axis] - wall.start[axis]) / whole) * far));
}

// options: {from: previous point, meet: points that the drawing must meet, reach: metres, free: no snapping}
export function snapped(site, point, { from = null, meet = [], reach = REACH_M, free = false } = {}) {
  if (free) return at(point);
  const met = nearest(meet, point, reach);
  if (met) return at(met);
  const ends = [...site.walls.flatMap((wall) => [wall.start, wall.end]), ...site.rooms.flatMap((room) => room.polygon)];
  const end = nearest(ends, point, reach);
  const axis = from ? straightAxis(from, point) : null;
  if (axis !== null) return straight(site, from, point, { axis, end, reach });
  if (end) return at(end);
  const wall = nearestWall(site, point, reach * WALL_SHARE);
  if (wall) return along(wall, gridAlong(wall, distance(wall.start, nearestOn(wall.start, wall.end, point))));
  return point.map((each) => rounded(each, GRID_M));
}

// The axis to which the line from the previous point is nearly parallel, or null.
function straightAxis(from, point) {
  const far = distance(point, from);
  return [0, 1].find((axis) => far > 0 && Math.abs(point[1 - axis] - from[1 - axis]) < STRAIGHT * far) ?? null;
}

// A point along an axis, at the coordinate of a near end, of the crossed wall, or of the grid.
function straight(site, from, point, { axis, end, reach }) {
  const made = (value) => at(axis === 0 ? [value, from[1]] : [from[0], value]);
  if (end) return made(end[axis]);
  const crossing = site.walls.map((wall) => crossedAt(wall, from, axis))
    .filter((value) => value !== null && Math.abs(value - point[axis]) < reach * WALL_SHARE)
    .sort((one, other) => Math.abs(one - point[axis]) - Math.abs(other - point[axis]))[0];
  return made(crossing ?? rounded(point[axis], GRID_M));
}

function crossedAt(wall, from, axis) {
  const [low, high] = [wall.start[1 - axis], wall.end[1 - axis]];
  const share = (from[1 - axis] - low) / (high - low);
  return Math.abs(high - low) > EXACT_M && share >= 0 && share <= 1 ? wall.start[axis] + share * (wall.end[axis] - wall.start[axis]) : null;
}

export function nearestWall(site, point, reach) {
  let best = null;
  let away = reach;
  for (const wall of site.walls) {
    const off = distance(point, nearestOn(wall.start, wall.end, point));
    if (off < away) [best, away] = [wall, off];
  }
  return best;
}
