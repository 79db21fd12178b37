// Vectors are arrays of three, attitudes unit quaternions with the scalar part first.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
];
const unit = (a) => scale(a, 1 / (Math.hypot(...a) || 1));
const sum = (...vectors) => vectors.reduce(add);

function decoded(text, Kind) {
  if (text === null) return null;
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  return new Kind(bytes.buffer);
}

// Spherical linear interpolation between unit quaternions, the shorter way round.
function slerp(from, to, part) {
  let cosine = from[0] * to[0] + from[1] * to[1] + from[2] * to[2] + from[3] * to[3];
  const sign = cosine < 0 ? -1 : 1;
  cosine = Math.min(1, Math.abs(cosine));
  const angle = Math.acos(cosine);
  let first = 1 - part;
  let second = part;
  if (angle > 1e-6) {
    first = Math.sin((1 - part) * angle) / Math.sin(angle);
    second = Math.sin(part * angle) / Math.sin(angle);
  }
  const mixed = from.map((value, place) => first * value + sign * second * to[place]);
  const length = Math.hypot(...mixed);
  return mixed.map((value) => value / length);
}

// Columns of the matrix that turns body into orbit components, C(q) transposed.
function bodyAxes([q0, q1, q2, q3]) {
  return [
    [1 - 2 * (q2 * q2 + q3 * q3), 2 * (q1 * q2 + q0 * q3), 2 * (q1 * q3 - q0 * q2)],
    [2 * (q1 * q2 - q0 * q3), 1 - 2 * (q1 * q1 + q3 * q3), 2 * (q2 * q3 + q0 * q1)],
    [2 * (q1 * q3 + q0 * q2), 2 * (q2 * q3 - q0 * q1), 1 - 2 * (q1 * q1 + q2 * q2)],
  ];
}

// Two unit vectors across a direction.
function across(direction) {
  const least = direction.map(Math.abs).indexOf(Math.min(...direction.map(Math.abs)));
  const first = unit(cross(direction, [0, 1, 2].map((place) => Number(place === least))));
  return [first, cross(direction, first)];
}

function circle(centre, direction, radius, count, from = 0, sweep = 2 * Math.PI) {
  const [first, second] = across(direction);
  return Array.from({ length: count + 1 }, (_, place) => {
    const angle = from + (sweep * place) / count;
    return sum(centre, scale(first, radius * Math.cos(angle)), scale(second, radius * Math.sin(angle)));
  });
}
