// Boxes, cylinders and balls with round edges, as three.js takes them.

// A box with round edges: on each side directions within 45 degrees of it, put on the inner box.
function roundedBox(half, radius) {
  var steps = 4, samples = [];
  [-1, 1].forEach(function (side) {
    for (var i = 0; i <= steps; i++) {
      samples.push([side, Math.tan(Math.PI / 4 * (side < 0 ? i / steps - 1 : i / steps))]);
    }
  });
  var n = samples.length, places = [], normals = [], index = [];
  for (var axis = 0; axis < 3; axis++) {
    [-1, 1].forEach(function (sign) {
      var first = places.length / 3;
      for (var a = 0; a < n; a++) for (var b = 0; b < n; b++) {
        var d = [0, 0, 0], inner = [0, 0, 0], u = (axis + 1) % 3, v = (axis + 2) % 3;
        d[axis] = sign; d[u] = samples[a][1]; d[v] = samples[b][1];
        inner[axis] = sign * (half[axis] - radius);
        inner[u] = samples[a][0] * (half[u] - radius);
        inner[v] = samples[b][0] * (half[v] - radius);
        var length = Math.hypot(d[0], d[1], d[2]);
        for (var k = 0; k < 3; k++) {
          normals.push(d[k] / length);
          places.push(inner[k] + radius * d[k] / length);
        }
      }
      for (a = 0; a < n - 1; a++) for (b = 0; b < n - 1; b++) {
        var p = first + a * n + b, q = p + n;
        if (sign > 0) index.push(p, q, q + 1, p, q + 1, p + 1);
        else index.push(p, q + 1, q, p, p + 1, q + 1);
      }
    });
  }
  var out = new THREE.BufferGeometry(), add = out.setAttribute || out.addAttribute;
  add.call(out, "position", new THREE.Float32BufferAttribute(places, 3));
  add.call(out, "normal", new THREE.Float32BufferAttribute(normals, 3));
  out.setIndex(index);
  return out;
}
// A cylinder along z with a rim of this radius; a capsule is one whose rim is its radius.
function roundedCylinder(radius, length, rim) {
  var profile = [new THREE.Vector2(0, -length / 2)], steps = 8, i, angle;
  for (i = 0; i <= steps; i++) {
    angle = Math.PI / 2 * i / steps;
    profile.push(new THREE.Vector2(radius - rim + rim * Math.sin(angle),
      -length / 2 + rim - rim * Math.cos(angle)));
  }
  for (i = 0; i <= steps; i++) {
    angle = Math.PI / 2 * i / steps;
    profile.push(new THREE.Vector2(radius - rim + rim * Math.cos(angle),
      length / 2 - rim + rim * Math.sin(angle)));
  }
  profile.push(new THREE.Vector2(0, length / 2));
  profile[0].x = profile[profile.length - 1].x = 1e-6;
  return new THREE.LatheBufferGeometry(profile, 36).rotateX(Math.PI / 2);
}
function geometry(link) {
  var s = link.size;
  if (link.shape === "sphere") return new THREE.SphereBufferGeometry(s[0], 36, 24);
  if (link.shape === "capsule") return roundedCylinder(s[0], s[1], s[0] * 0.999);
  if (link.shape === "cylinder") {
    return roundedCylinder(s[0], s[1], 0.3 * Math.min(s[0], s[1] / 2));
  }
  var half = [s[0] / 2, s[1] / 2, s[2] / 2];
  return roundedBox(half, 0.42 * Math.min(half[0], half[1], half[2]));
}
