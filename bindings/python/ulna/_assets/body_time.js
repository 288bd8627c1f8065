// Playing, and values over time.

var time = 0, playing = false, before = 0, speed = 1;
function go(t) {
  time = Math.min(duration, Math.max(0, t));
  dirty = true;
  show();
}
function step(by) {  // to the next frame of the scene that has more of them
  var scene = data.scenes.reduce(function (a, b) { return b.frames > a.frames ? b : a; });
  pause();
  var frame = frameAt(scene, time) + by;
  go(scene.time[Math.min(scene.frames - 1, Math.max(0, frame))]);
}
function play() {
  if (duration <= 0) return;
  if (time >= duration) go(0);
  playing = true;
  before = performance.now();
  button();
}
function pause() { playing = false; button(); }
function button() {
  $("play").querySelector("path").setAttribute("d",
    playing ? "M3 2h4v12H3zM9 2h4v12H9z" : "M3 1.5v13l11-6.5z");
  $("play").querySelector("span").textContent = playing ? "Pause" : "Play";
}
function loop(now) {
  if (playing) {
    go(time + speed * Math.min(0.25, (now - before) / 1000));
    if (time >= duration) pause();
  }
  before = now;
  if (ready && dirty) render();
  requestAnimationFrame(loop);
}
function seconds(t) { return t.toFixed(2) + "\u00a0s"; }
function show() {
  $("scrub").value = time;
  $("scrub").setAttribute("aria-valuetext", seconds(time));
  $("clock").textContent = seconds(time) + " of " + seconds(duration);
  data.scenes.forEach(function (scene, i) {
    var frame = frameAt(scene, time), over = scene.last < duration && time > scene.last + 1e-6;
    $("heads").children[i].querySelector("span").textContent = over
      ? "ended at " + seconds(scene.last) : scene.series_name + " " + told(scene.series[frame], NaN);
    var line = $("now").children[i];
    line.lastChild.textContent = (data.scenes.length > 1 ? scene.name + " " : "") + reading(scene, frame);
  });
  cursor();
}
function reading(scene, frame) {
  var k = chosenPart(scene);
  if (k === -1) return told(scene.series[frame], NaN);
  return k < -1 ? "no such part" : told(valueOf(scene, k, frame, false), valueOf(scene, k, frame, true));
}

// Over time ---------------------------------------------------------------------------------------

var chosen = "";  // the name of a part; empty for the whole body
function chosenPart(scene) {
  if (chosen === "") return -1;
  for (var k = 0; k < scene.parts.length; k++) if (scene.parts[k].name === chosen) return k;
  return -2;
}
function choose(name) {
  var options = Array.prototype.map.call($("part").options, function (o) { return o.value; });
  if (options.indexOf(name) < 0) return;
  chosen = name;
  $("part").value = name;
  chart();
  show();
}
var box = {left: 46, right: 8, top: 8, bottom: 22, w: 600, h: 136, low: 0, high: 1};
function chartX(t) {
  return box.left + (box.w - box.left - box.right) * (duration > 0 ? t / duration : 0);
}
function chartY(v) {
  return box.h - box.bottom - (box.h - box.top - box.bottom) * (v - box.low) / (box.high - box.low);
}
function element(name, attributes) {
  var out = document.createElementNS("http://www.w3.org/2000/svg", name);
  Object.keys(attributes).forEach(function (k) { out.setAttribute(k, attributes[k]); });
  return out;
}
function nice(span, count) {  // a round step that divides the span about so often
  var raw = span / count, ten = Math.pow(10, Math.floor(Math.log10(raw)));
  return [1, 2, 2.5, 5, 10].filter(function (m) { return m * ten >= raw * 0.999; })[0] * ten;
}
function chart() {
  var svg = $("chart"), low = 0, high = 0;
  box.w = svg.clientWidth || 600; box.h = svg.clientHeight || 136;
  svg.setAttribute("viewBox", "0 0 " + box.w + " " + box.h);
  svg.textContent = "";
  var series = data.scenes.map(function (scene) {
    var k = chosenPart(scene), values = [], deviations = [], i, v, d;
    for (i = 0; i < scene.frames; i++) {
      v = k === -1 ? scene.series[i] : k < 0 ? NaN : valueOf(scene, k, i, false);
      d = k < 0 ? NaN : valueOf(scene, k, i, true);
      values.push(v); deviations.push(d);
      if (isFinite(v)) {
        low = Math.min(low, v - (isFinite(d) ? 1.96 * d : 0), 0);
        high = Math.max(high, v + (isFinite(d) ? 1.96 * d : 0));
      }
    }
    return {scene: scene, values: values, deviations: deviations};
  });
  if (low < 0 && !(data.low < 0)) low = 0;  // an interval may reach below what can be
  if (!(high > low)) high = low + 1;
  var step = nice(high - low, 3), y, t;
  box.low = Math.floor(low / step + 1e-9) * step;
  box.high = Math.ceil(high / step - 1e-9) * step;
  for (y = box.low; y <= box.high + step / 2; y += step) {
    svg.append(element("line", {x1: box.left, x2: box.w - box.right, y1: chartY(y), y2: chartY(y), "class": "grid"}));
    var mark = element("text", {x: box.left - 6, y: chartY(y) + 4, "text-anchor": "end"});
    mark.textContent = String(+y.toPrecision(6)).replace("-", "\u2212");
    svg.append(mark);
  }
  if (duration > 0) {
    var wide = nice(duration, Math.max(2, Math.min(10, box.w / 110)));
    for (t = 0; t <= duration + 1e-9; t += wide) {
      var near = chartX(t) > box.w - 40;
      var label = element("text", {x: chartX(t), y: box.h - 5, "text-anchor": near ? "end" : "middle"});
      label.textContent = +t.toPrecision(6) + " s";
      svg.append(label);
    }
  }
  series.forEach(function (one, i) {
    var colour = lineColour(i);
    pieces(one.values).forEach(function (piece) {
      var upper = "", under = "", line = "", banded = true;
      for (var k = piece[0]; k < piece[1]; k++) {
        var x = chartX(one.scene.time[k]).toFixed(1), d = 1.96 * one.deviations[k];
        line += (line ? "L" : "M") + x + " " + chartY(one.values[k]).toFixed(1);
        if (!isFinite(d)) { banded = false; continue; }
        upper += (upper ? "L" : "M") + x + " " + chartY(Math.min(box.high, one.values[k] + d)).toFixed(1);
        under = "L" + x + " " + chartY(Math.max(box.low, one.values[k] - d)).toFixed(1) + under;
      }
      if (piece[1] - piece[0] === 1) line += "h1.5";
      if (banded) svg.append(element("path", {d: upper + under + "Z", "class": "band", style: "fill:" + colour}));
      svg.append(element("path", {d: line, "class": "line", style: "stroke:" + colour}));
    });
  });
  svg.append(element("line", {id: "cursor", "class": "cursor", y1: box.top, y2: box.h - box.bottom}));
  cursor();
}
function pieces(values) {  // runs of known values, as [first, one past the last]
  var out = [], first = -1;
  for (var i = 0; i <= values.length; i++) {
    var known = i < values.length && isFinite(values[i]);
    if (known && first < 0) first = i;
    if (!known && first >= 0) { out.push([first, i]); first = -1; }
  }
  return out;
}
function cursor() {
  var line = $("cursor");
  if (!line) return;
  line.setAttribute("x1", chartX(time));
  line.setAttribute("x2", chartX(time));
}
function fromChart(event) {
  var at = event.clientX - $("chart").getBoundingClientRect().left;
  pause();
  go((at - box.left) / (box.w - box.left - box.right) * duration);
}
$("chart").addEventListener("pointerdown", function (event) {
  $("chart").setPointerCapture(event.pointerId);
  fromChart(event);
});
$("chart").addEventListener("pointermove", function (event) { if (event.buttons) fromChart(event); });
