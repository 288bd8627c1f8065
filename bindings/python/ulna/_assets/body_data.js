// What the page holds: numbers of frames, links and colours, and how they are told.

var $ = function (id) { return document.getElementById(id); };
var data = JSON.parse($("data").textContent);
var NO_POSE = -32768;

function bytes(text) {
  var raw = atob(text), out = new Uint8Array(raw.length);
  for (var i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out;
}
// By DataView: what a base64 holds is little-endian on every machine.
function floats(text) {
  if (text === null) return null;
  var view = new DataView(bytes(text).buffer), out = new Float32Array(view.byteLength / 4);
  for (var i = 0; i < out.length; i++) out[i] = view.getFloat32(4 * i, true);
  return out;
}
function integers(text) {
  var view = new DataView(bytes(text).buffer), out = new Int16Array(view.byteLength / 2);
  for (var i = 0; i < out.length; i++) out[i] = view.getInt16(2 * i, true);
  return out;
}
data.scenes.forEach(function (scene) {
  ["time", "effort", "effort_sd", "joint_effort", "joint_effort_sd", "force", "series"]
    .forEach(function (name) { scene[name] = floats(scene[name]); });
  scene.position = integers(scene.position);
  scene.rotation = integers(scene.rotation);
  scene.frames = scene.time.length;
  scene.last = scene.time[scene.frames - 1];
  // Links, then joints, under one index.
  scene.parts = scene.links.concat(scene.joints);
});
var duration = Math.max.apply(null, data.scenes.map(function (s) { return s.last; }));

function frameAt(scene, t) {  // the last frame that is not later
  var low = 0, high = scene.frames - 1;
  while (low < high) {
    var middle = (low + high + 1) >> 1;
    if (scene.time[middle] <= t + 1e-6) low = middle; else high = middle - 1;
  }
  return low;
}
function valueOf(scene, part, frame, deviation) {
  var n = scene.links.length, end = deviation ? "_sd" : "";
  var array = part < n ? scene["effort" + end] : scene["joint_effort" + end];
  if (!array) return NaN;
  return part < n ? array[frame * n + part] : array[frame * scene.joints.length + part - n];
}
function number(value) {
  if (!isFinite(value)) return "not known";
  return value.toFixed(digits(value)).replace("-", "\u2212");
}
function digits(value) {
  var size = Math.abs(value);
  return size >= 100 || size === 0 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3;
}
function told(value, deviation) {
  if (!isFinite(value)) return "not known";
  var spread = "";
  if (isFinite(deviation)) spread = " \u00b1 " + deviation.toFixed(digits(value));
  return number(value) + spread + "\u00a0" + data.unit.replace(/ /g, "\u00a0");
}
// The second condition, often the one with a device, has the colour of a device; so has one alone.
function lineColour(i) {
  return i || data.scenes.length === 1 ? "var(--two)" : "var(--one)";
}
function colourIndex(value) {
  var share = (value - data.low) / (data.high - data.low);
  return Math.round(Math.min(1, Math.max(0, share)) * (data.colours.length - 1));
}
function plainColour(scene, part) {
  var link = scene.links[part];
  if (!link) return data.missing;
  if (link.role === "device") return data.device;
  if (link.role === "tool") return data.tool;
  return scene.effort ? data.missing : data.plain;
}
