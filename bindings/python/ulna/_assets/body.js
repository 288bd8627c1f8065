// The page of a moving body: furnishes it, starts it, listens to the keyboard. Works with three.js
// release 111 or near. `window.ulna` tells what is shown, for tests and for a reader with a console.

function furnish() {
  var heads = $("heads");
  heads.classList.toggle("single", data.scenes.length === 1);
  data.scenes.forEach(function (scene, i) {
    var colour = lineColour(i);
    var head = document.createElement("div"), name = document.createElement("b");
    name.textContent = scene.name;
    name.style.setProperty("--c", colour);
    head.append(name, document.createElement("span"));
    heads.append(head);
    var line = document.createElement("span"), key = document.createElement("i");
    key.style.setProperty("--c", colour);
    line.append(key, document.createTextNode(""));
    $("now").append(line);
  });
  var paint = $("bar-colours").getContext("2d"), n = data.colours.length;
  for (var y = 0; y < 256; y++) {
    paint.fillStyle = data.colours[Math.round((255 - y) / 255 * (n - 1))];
    paint.fillRect(0, y, 12, 1);
  }
  $("bar-title").textContent = data.quantity + " (" + data.unit + ")";
  var step = nice(data.high - data.low, 5);
  for (var v = Math.ceil(data.low / step - 1e-9) * step; v <= data.high + step * 1e-6; v += step) {
    var tick = document.createElement("span"), last = v + step > data.high + step * 1e-6;
    tick.textContent = (last && data.over ? "\u2265 " : v <= data.low + step * 1e-6 && data.under ? "\u2264 " : "") +
      String(+v.toPrecision(6)).replace("-", "\u2212");
    tick.style.bottom = 100 * (v - data.low) / (data.high - data.low) + "%";
    $("bar-ticks").append(tick);
  }
  [["device", "exoskeleton", data.device], ["tool", "tool", data.tool], ["missing", "not known", data.missing],
    ["force", "force", data.force]].forEach(function (key) {
    if (!data.legend[key[0]]) return;
    var item = document.createElement("li"), chip = document.createElement("i");
    chip.style.setProperty("--c", key[2]);
    if (key[0] === "force") chip.className = "line";
    item.append(chip, key[1]);
    $("legend").append(item);
  });
  var option = new Option("whole body, " + data.scenes[0].series_name, "");
  $("part").append(option);
  var seen = {};
  data.scenes.forEach(function (scene) {
    scene.parts.forEach(function (part, k) {
      var known = false;
      for (var f = 0; f < scene.frames && !known; f++) known = isFinite(valueOf(scene, k, f, false));
      if (known && !seen["#" + part.name]) $("part").append(new Option(part.name, part.name));
      if (known) seen["#" + part.name] = true;
    });
  });
  $("scrub").max = duration;
  $("scrub").disabled = $("play").disabled = duration <= 0;
  $("over").textContent = "Over time (" + data.unit + "):";
  button();
}

$("play").addEventListener("click", function () { if (playing) pause(); else play(); });
$("scrub").addEventListener("input", function () { pause(); go(+$("scrub").value); });
$("speed").addEventListener("change", function () { speed = +$("speed").value; });
$("part").addEventListener("change", function () { choose($("part").value); });
$("views").addEventListener("click", function (event) {
  var name = event.target.getAttribute("data-view");
  if (name && ready) { touched = name !== "home"; views(name); }
});
document.addEventListener("keydown", function (event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  var tag = event.target.tagName, key = event.key, stage = event.target === $("canvas");
  if (tag === "SELECT" || (tag === "INPUT" && /^(Arrow|Home|End|Page)/.test(key))) return;
  if (key === " " && (tag === "BUTTON" || tag === "SUMMARY")) return;
  if (key === " ") { if (playing) pause(); else play(); }
  else if (key === ",") step(-1);
  else if (key === ".") step(1);
  else if (key === "Home") { pause(); go(0); }
  else if (key === "End") { pause(); go(duration); }
  else if (ready && /^[0-4]$/.test(key)) {
    touched = key !== "0";
    views(["home", "front", "left", "right", "back"][+key]);
  } else if (ready && stage && /^Arrow|^[+=-]$/.test(key)) {
    turn(key);
  } else return;
  event.preventDefault();
});
function turn(key) {
  touched = true;
  var from = camera.position.clone().sub(controls.target), ball = new THREE.Spherical();
  var along = new THREE.Quaternion().setFromUnitVectors(camera.up, new THREE.Vector3(0, 1, 0));
  ball.setFromVector3(from.applyQuaternion(along));
  if (key === "ArrowLeft") ball.theta -= 0.12;
  if (key === "ArrowRight") ball.theta += 0.12;
  if (key === "ArrowUp") ball.phi -= 0.08;
  if (key === "ArrowDown") ball.phi += 0.08;
  if (key === "+" || key === "=") ball.radius = Math.max(0.3, ball.radius / 1.1);
  if (key === "-") ball.radius = Math.min(40, ball.radius * 1.1);
  ball.phi = Math.min(Math.PI - 0.02, Math.max(0.02, ball.phi));
  camera.position.setFromSpherical(ball).applyQuaternion(along.inverse ? along.inverse() : along.invert())
    .add(controls.target);
  controls.update();
  dirty = true;
}

function hash() {
  var t = /(?:^#|&)t=([0-9.]+)/.exec(location.hash);
  if (t && isFinite(+t[1])) go(+t[1]);
  return !!t;
}
window.addEventListener("hashchange", hash);

furnish();
try {
  start();
  ready = true;
} catch (failure) {
  trouble("This browser does not draw in 3-D (WebGL is off or missing); the values over time below still work.");
}
window.addEventListener("resize", function () { if (ready) resize(); else chart(); });
var dark = window.matchMedia("(prefers-color-scheme: dark)");
var recolour = function () {
  worlds.forEach(floor);
  dirty = true;
};
if (dark.addEventListener) dark.addEventListener("change", recolour);
chart();
if (!hash()) go(data.start);
show();
requestAnimationFrame(loop);

window.ulna = {
  ready: function () { return ready && !dirty; },
  go: go, play: play, pause: pause, choose: choose, view: views,
  state: function () {
    return {time: time, playing: playing, drawn: drawn, chosen: chosen, pointed: pointed,
      eye: ready ? camera.position.toArray() : null,
      frames: data.scenes.map(function (s) { return frameAt(s, time); }),
      colours: worlds.map(function (w) {
        return w.parts.map(function (p) {
          return p.holder.visible ? "#" + p.mesh.material.color.getHexString() : null;
        });
      }),
      names: data.scenes.map(function (s) { return s.parts.map(function (p) { return p.name; }); })};
  },
  // Where a part is on the stage, in pixels from its left and top.
  where: function (scene, part) {
    var world = worlds[scene], w = $("stage").clientWidth / worlds.length;
    world.scene.updateMatrixWorld();
    camera.updateMatrixWorld();
    var p = new THREE.Vector3().setFromMatrixPosition(world.parts[part].mesh.matrixWorld).project(camera);
    return [(scene + (p.x + 1) / 2) * w, (1 - p.y) / 2 * $("stage").clientHeight];
  }
};
