// The stage: bodies, floor, light, the eye, and what is pointed at.

var renderer = null, camera = null, controls = null, worlds = [], target = null, reach = 1;
var ready = false, dirty = true;

function cssColour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

function build(scene) {
  var world = {scene: new THREE.Scene(), parts: [], arrows: [], from: scene};
  var ambient = new THREE.HemisphereLight(0xffffff, 0xd9d4ce, 0.80);
  ambient.position.set(0, 0, 1);
  world.scene.add(ambient);
  // The lamp hangs beside the eye, so that what is seen is lit from wherever one looks.
  world.lamp = new THREE.DirectionalLight(0xffffff, 0.30);
  world.scene.add(world.lamp, world.lamp.target);
  // A second one from high above throws the shadow and gives no light of its own to speak of.
  world.sun = new THREE.DirectionalLight(0xffffff, 0.06);
  world.sun.castShadow = true;
  world.sun.shadow.mapSize.set(512, 512);
  world.sun.shadow.radius = 3;
  world.sun.shadow.bias = -0.002;
  world.scene.add(world.sun, world.sun.target);
  world.stage = new THREE.Group();
  world.scene.add(world.stage);

  scene.links.concat(scene.joints).forEach(function (part, k) {
    var ball = k >= scene.links.length;
    var shape = ball ? new THREE.SphereBufferGeometry(part.radius, 32, 20) : geometry(part);
    var material = new THREE.MeshLambertMaterial();
    var mesh = new THREE.Mesh(shape, material), holder = new THREE.Group();
    if (ball) {
      mesh.position.fromArray(part.at);
      // What the body hides of a ball shines through it.
      var glow = new THREE.MeshBasicMaterial({transparent: true, opacity: 0.5, depthTest: false,
        depthWrite: false});
      mesh.add(new THREE.Mesh(shape, glow));
      mesh.children[0].renderOrder = 1;
      mesh.children[0].raycast = function () {};
    } else {
      mesh.position.fromArray(part.centre);
      var q = part.rotation;
      mesh.quaternion.set(q[1], q[2], q[3], q[0]).normalize();
    }
    mesh.castShadow = true;
    mesh.userData = {part: k};
    holder.add(mesh);
    world.stage.add(holder);
    world.parts.push({holder: holder, mesh: mesh, ball: ball});
  });
  scene.forces.forEach(function () {
    var arrow = new THREE.Group();
    var paint = new THREE.MeshLambertMaterial({color: data.force, emissive: data.force,
      emissiveIntensity: 0.15});
    arrow.shaft = new THREE.Mesh(new THREE.CylinderBufferGeometry(0.010, 0.010, 1, 16), paint);
    arrow.head = new THREE.Mesh(new THREE.ConeBufferGeometry(0.026, 0.07, 20), paint);
    // The push of the ground runs up inside of the leg: it shines through as well.
    var glow = new THREE.MeshBasicMaterial({color: data.force, transparent: true, opacity: 0.6,
      depthTest: false, depthWrite: false});
    [arrow.shaft, arrow.head].forEach(function (part) {
      part.add(new THREE.Mesh(part.geometry, glow));
      part.children[0].renderOrder = 1;
    });
    arrow.add(arrow.shaft, arrow.head);
    world.stage.add(arrow);
    world.arrows.push(arrow);
  });
  return world;
}

// The room that is used over all frames, and whether the body walks away.
function measure(scene) {
  var low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9], walked = [1e9, 1e9, -1e9, -1e9];
  var every = Math.max(1, Math.floor(scene.frames / 200)), middle = new THREE.Vector3();
  for (var frame = 0; frame < scene.frames; frame += every) {
    scene.links.forEach(function (link, k) {
      if (!poseAt(scene, k, frame, placeA, quatA)) return;
      if (k === 0) {
        walked = [Math.min(walked[0], placeA.x), Math.min(walked[1], placeA.y),
          Math.max(walked[2], placeA.x), Math.max(walked[3], placeA.y)];
      }
      var s = link.size, half = link.shape === "box" ? Math.hypot(s[0], s[1], s[2]) / 2
        : link.shape === "sphere" ? s[0] : Math.hypot(s[0], s[1] / 2);
      // Of a long shape only the thickness counts beside it: its ends are found along its axis.
      var along = link.shape === "box" ? [s[0] / 2, s[1] / 2, s[2] / 2]
        : link.shape === "sphere" ? [s[0], s[0], s[0]] : [s[0], s[0], s[1] / 2];
      var turned = quatA.clone().multiply(quatB.set(link.rotation[1], link.rotation[2],
        link.rotation[3], link.rotation[0]).normalize());
      middle.fromArray(link.centre).applyQuaternion(quatA).add(placeA);
      var reach = [0, 0, 0];
      along.forEach(function (length, axis) {
        placeB.set(axis === 0 ? length : 0, axis === 1 ? length : 0, axis === 2 ? length : 0)
          .applyQuaternion(turned);
        reach[0] += Math.abs(placeB.x); reach[1] += Math.abs(placeB.y); reach[2] += Math.abs(placeB.z);
      });
      [middle.x, middle.y, middle.z].forEach(function (x, axis) {
        var most = Math.min(half, reach[axis]);
        low[axis] = Math.min(low[axis], x - most);
        high[axis] = Math.max(high[axis], x + most);
      });
    });
  }
  if (low[0] > high[0]) { low = [-0.3, -0.3, 0]; high = [0.3, 0.3, 1.7]; }
  scene.low = low;
  scene.high = high;
  scene.follow = Math.max(walked[2] - walked[0], walked[3] - walked[1]) > 1.5;
}

function floor(world) {
  (world.floor || []).forEach(function (one) {
    world.stage.remove(one);
    one.geometry.dispose();
    one.material.dispose();
  });
  var scene = world.from, size = 8;  // m; larger where the body uses more room, but stays in sight
  if (!scene.follow) {
    size = 2 * Math.ceil(Math.max(scene.high[0] - scene.low[0], scene.high[1] - scene.low[1]) + 1);
  }
  var grid = new THREE.GridHelper(size, 2 * size, cssColour("--grid"), cssColour("--grid"));
  grid.rotation.x = Math.PI / 2;
  grid.material.transparent = true;
  grid.material.opacity = 0.55;
  var ground = new THREE.Mesh(new THREE.PlaneBufferGeometry(size, size),
    new THREE.ShadowMaterial({opacity: 0.28}));
  ground.receiveShadow = true;
  world.floor = [grid, ground];
  world.floor.forEach(function (one) { world.stage.add(one); });
}
// Under the body; where that walks, the lines of the floor stay where they are in the world.
function underneath(world, x, y) {
  world.floor.forEach(function (one, i) {
    one.position.set(world.from.follow ? Math.round(x) : x, world.from.follow ? Math.round(y) : y,
      world.from.floor - 0.001 * (2 - i));
  });
}

var quatA, quatB, placeA, placeB;
function poseAt(scene, link, frame, place, quat) {
  var n = scene.links.length, i = (frame * n + link) * 3, j = (frame * n + link) * 4;
  if (scene.position[i] === NO_POSE) return false;
  place.set(scene.position[i], scene.position[i + 1], scene.position[i + 2])
    .multiplyScalar(scene.reach / 32767);
  place.x += scene.centre[0]; place.y += scene.centre[1]; place.z += scene.centre[2];
  quat.set(scene.rotation[j + 1], scene.rotation[j + 2], scene.rotation[j + 3],
    scene.rotation[j]).normalize();
  return true;
}

function pose(world, t) {
  var scene = world.from, frame = frameAt(scene, t), next = Math.min(frame + 1, scene.frames - 1);
  var gap = scene.time[next] - scene.time[frame];
  var share = gap > 0 ? Math.min(1, Math.max(0, (t - scene.time[frame]) / gap)) : 0;
  if (gap > 0.5) share = 0;  // nothing is known of what happened in a long gap
  world.frame = frame;
  var middle = new THREE.Vector3(), known = 0;
  world.parts.forEach(function (part, k) {
    var link = part.ball ? scene.joints[k - scene.links.length].link : k;
    var shown = poseAt(scene, link, frame, placeA, quatA);
    if (shown && share > 0 && poseAt(scene, link, next, placeB, quatB)) {
      placeA.lerp(placeB, share);
      quatA.slerp(quatB, share);
    }
    part.holder.visible = shown;
    if (shown) {
      part.holder.position.copy(placeA);
      part.holder.quaternion.copy(quatA);
      if (!part.ball && scene.links[k].role === "body") { middle.add(placeA); known++; }
    }
    var value = valueOf(scene, k, frame, false);
    var colour = isFinite(value) ? data.colours[colourIndex(value)] : plainColour(scene, k);
    part.mesh.material.color.set(colour);
    if (part.ball) part.mesh.children[0].material.color.set(colour);
    part.mesh.material.emissive.set(k === pointed && world === pointedWorld ? 0x262626 : 0);
  });
  scene.forces.forEach(function (force, k) {
    var arrow = world.arrows[k], i = (frame * scene.forces.length + k) * 3;
    var push = new THREE.Vector3(scene.force[i], scene.force[i + 1], scene.force[i + 2])
      .multiplyScalar(data.metres_per_newton);
    var length = push.length(), holder = world.parts[force.link].holder;
    arrow.visible = isFinite(length) && length > 0.005 && holder.visible;
    if (!arrow.visible) return;
    var head = Math.min(0.07, 0.5 * length);
    arrow.position.fromArray(force.at).applyQuaternion(holder.quaternion).add(holder.position);
    arrow.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), push.divideScalar(length));
    arrow.shaft.scale.set(1, length - head, 1);
    arrow.shaft.position.y = (length - head) / 2;
    arrow.head.scale.set(1, head / 0.07, 1);
    arrow.head.position.y = length - head / 2;
  });
  // The middle of the place in use stands at the origin, the floor at its own height.
  var x = (scene.low[0] + scene.high[0]) / 2, y = (scene.low[1] + scene.high[1]) / 2;
  if (scene.follow && known) { x = middle.x / known; y = middle.y / known; }
  world.stage.position.set(-x, -y, -scene.floor);
  underneath(world, x, y);
}

function views(name) {
  var angles = {home: [35, 12], front: [0, 8], left: [90, 8], right: [-90, 8], back: [180, 8]};
  var a = (angles[name] || angles.home).map(function (d) { return d * Math.PI / 180; });
  controls.target.copy(target);
  camera.position.set(Math.cos(a[1]) * Math.cos(a[0]), Math.cos(a[1]) * Math.sin(a[0]),
    Math.sin(a[1])).multiplyScalar(distance()).add(target);
  controls.update();
  dirty = true;
}
// So far that the body fills the height, or the width where that is less.
function distance() {
  var half = Math.tan(camera.fov * Math.PI / 360);
  return Math.max(tall / 2 / half, wide / 2 / (half * camera.aspect)) * 1.18 + wide / 5;
}
var tall = 2, wide = 1.5;

function resize() {
  var stage = $("stage"), w = stage.clientWidth, h = stage.clientHeight;
  renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
  renderer.setSize(w, h, false);
  var before = camera.aspect;
  camera.aspect = w / data.scenes.length / h;
  camera.updateProjectionMatrix();
  if (Math.abs(before - camera.aspect) > 0.02 && !touched) views("home");
  chart();
  dirty = true;
}
var touched = false;

function render() {
  var size = renderer.getSize(new THREE.Vector2()), w = size.x / worlds.length;
  renderer.setScissorTest(true);
  worlds.forEach(function (world, i) {
    pose(world, time);
    var side = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 0);
    var up = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 1);
    var towards = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 2);
    world.lamp.position.copy(target).addScaledVector(side, 0.8).addScaledVector(up, 2.2)
      .addScaledVector(towards, 3);
    world.lamp.target.position.copy(target);
    world.sun.position.set(1.0, 1.2, 6).add(target);
    world.sun.target.position.copy(target);
    renderer.setViewport(i * w, 0, w, size.y);
    renderer.setScissor(i * w, 0, w, size.y);
    renderer.render(world.scene, camera);
  });
  dirty = false;
  drawn++;
}
var drawn = 0;

function start() {
  var canvas = $("canvas");
  renderer = new THREE.WebGLRenderer({canvas: canvas, antialias: true, alpha: true,
    preserveDrawingBuffer: true});
  renderer.setClearColor(0x000000, 0);
  renderer.autoClear = true;
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = THREE.PCFShadowMap;
  quatA = new THREE.Quaternion(); quatB = new THREE.Quaternion();
  placeA = new THREE.Vector3(); placeB = new THREE.Vector3();
  camera = new THREE.PerspectiveCamera(24, 1, 0.05, 200);
  camera.up.set(0, 0, 1);
  tall = wide = 0;
  data.scenes.forEach(function (scene) {
    measure(scene);
    var across = scene.follow ? 1.8 : Math.hypot(scene.high[0] - scene.low[0],
      scene.high[1] - scene.low[1]);
    tall = Math.max(tall, scene.high[2] - Math.min(scene.floor, scene.low[2]), 0.2);
    wide = Math.max(wide, across);
  });
  // A little above the middle: the names of the conditions stand at the top.
  target = new THREE.Vector3(0, 0, 0.54 * tall);
  data.scenes.forEach(function (scene) {
    var world = build(scene);
    floor(world);
    var half = Math.max(tall, wide) * 0.75, lens = world.sun.shadow.camera;
    lens.left = lens.bottom = -half; lens.right = lens.top = half;
    lens.near = 0.5; lens.far = 6 + 2 * tall;
    worlds.push(world);
  });
  controls = new THREE.OrbitControls(camera, canvas);
  controls.enableKeys = false;
  controls.minDistance = 0.3; controls.maxDistance = 40;
  controls.addEventListener("change", function () { dirty = true; });
  controls.addEventListener("start", function () { touched = true; tip(null); });
  canvas.addEventListener("webglcontextlost", function (event) {
    event.preventDefault();
    trouble("The graphics of this browser stopped; load the page again.");
  });
  views("home");
  resize();
  views("home");
}

function trouble(words) {
  $("trouble").textContent = words;
  $("trouble").hidden = false;
}

// Pointing ----------------------------------------------------------------------------------------

var pointed = -1, pointedWorld = null, ray = null;
function find(x, y) {  // what is at this place of the stage
  if (!ready) return null;
  var w = $("stage").clientWidth / worlds.length, h = $("stage").clientHeight;
  var i = Math.min(worlds.length - 1, Math.max(0, Math.floor(x / w)));
  ray = ray || new THREE.Raycaster();
  ray.setFromCamera({x: (x - i * w) / w * 2 - 1, y: 1 - y / h * 2}, camera);
  worlds[i].scene.updateMatrixWorld();
  var meshes = worlds[i].parts.filter(function (p) { return p.holder.visible; })
    .map(function (p) { return p.mesh; });
  var hits = ray.intersectObjects(meshes, false), n = worlds[i].from.links.length;
  if (!hits.length) return null;
  // A ball that shines through can be pointed at like one in front.
  var ball = hits.filter(function (hit) { return hit.object.userData.part >= n; })[0];
  return {world: worlds[i], part: (ball || hits[0]).object.userData.part};
}
function tip(found, x, y) {
  var box = $("tip");
  pointed = found ? found.part : -1;
  pointedWorld = found ? found.world : null;
  $("canvas").classList.toggle("over", !!found);
  dirty = true;
  box.hidden = !found;
  if (!found) return;
  var scene = found.world.from, frame = frameAt(scene, time), role = (scene.links[found.part] || {}).role;
  var value = valueOf(scene, found.part, frame, false);
  box.textContent = "";
  var name = document.createElement("b"), line = document.createElement("span");
  name.textContent = scene.parts[found.part].name;
  var silent = role && (role !== "body" || !scene.effort) && !isFinite(value);
  line.textContent = silent ? (role === "body" ? "" : role === "device" ? "exoskeleton" : "tool")
    : data.quantity + " " + told(value, valueOf(scene, found.part, frame, true));
  box.append(name, line);
  var w = $("stage").clientWidth, h = $("stage").clientHeight;
  x = Math.min(x + 14, w - box.offsetWidth - 8);
  y = y + 16 + box.offsetHeight > h ? y - box.offsetHeight - 10 : y + 16;
  box.style.transform = "translate(" + Math.round(x) + "px," + Math.round(y) + "px)";
}
function place(event) {
  var box = $("stage").getBoundingClientRect();
  return [event.clientX - box.left, event.clientY - box.top];
}
var pressed = null;
$("canvas").addEventListener("pointermove", function (event) {
  if (event.buttons) return;
  var at = place(event);
  tip(find(at[0], at[1]), at[0], at[1]);
});
$("canvas").addEventListener("pointerleave", function () { tip(null); });
$("canvas").addEventListener("pointerdown", function (event) { pressed = place(event); });
$("canvas").addEventListener("pointerup", function (event) {
  var at = place(event);
  if (!pressed || Math.hypot(at[0] - pressed[0], at[1] - pressed[1]) > 4) return;
  var found = find(at[0], at[1]);
  if (found) {
    tip(found, at[0], at[1]);
    choose(found.world.from.parts[found.part].name);
  }
});
