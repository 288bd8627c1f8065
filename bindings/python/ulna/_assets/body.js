/* The page of a moving body. Reads the data of the page, draws with three.js (release 111 or near),
   and publishes what it does as `window.ulna`, for tests and for a reader with a console. */
(function () {
  "use strict";

  var $ = function (id) { return document.getElementById(id); };
  var data = JSON.parse($("data").textContent);
  var NO_POSE = -32768;

  // Data -----------------------------------------------------------------------------------------

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

  // Shapes ---------------------------------------------------------------------------------------

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

  // Scenes ---------------------------------------------------------------------------------------

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
    world.sun.shadow.mapSize.set(1024, 1024);
    world.sun.shadow.radius = 3;
    world.sun.shadow.bias = -0.002;
    world.scene.add(world.sun, world.sun.target);
    world.stage = new THREE.Group();
    world.scene.add(world.stage);

    scene.links.concat(scene.joints).forEach(function (part, k) {
      var ball = k >= scene.links.length;
      var shape = ball ? new THREE.SphereBufferGeometry(part.radius, 32, 20) : geometry(part);
      var material = new THREE.MeshStandardMaterial({roughness: 0.75, metalness: 0.0});
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
      var paint = new THREE.MeshStandardMaterial({color: data.force, roughness: 0.6,
        emissive: data.force, emissiveIntensity: 0.45});
      arrow.shaft = new THREE.Mesh(new THREE.CylinderBufferGeometry(0.010, 0.010, 1, 16), paint);
      arrow.head = new THREE.Mesh(new THREE.ConeBufferGeometry(0.026, 0.07, 20), paint);
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

  function floor(world, span) {
    var height = world.from.floor;
    if (world.floor) {
      world.floor.forEach(function (one) {
        world.stage.remove(one);
        one.geometry.dispose();
        one.material.dispose();
      });
    }
    var lines = Math.max(4, Math.ceil(span)) * 2;
    var grid = new THREE.GridHelper(lines, lines * 2, cssColour("--grid"), cssColour("--grid"));
    grid.rotation.x = Math.PI / 2;
    grid.material.transparent = true;
    grid.material.opacity = 0.55;
    var ground = new THREE.Mesh(new THREE.PlaneBufferGeometry(lines, lines),
      new THREE.ShadowMaterial({opacity: 0.28}));
    ground.receiveShadow = true;
    [grid, ground].forEach(function (one, i) {
      one.position.set((world.from.low[0] + world.from.high[0]) / 2,
        (world.from.low[1] + world.from.high[1]) / 2, height - 0.001 * (2 - i));
      one.raycast = function () {};
      world.stage.add(one);
    });
    world.floor = [grid, ground];
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
      world.lamp.position.copy(target).addScaledVector(side, 1.4).addScaledVector(up, 2.2)
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
    renderer.shadowMap.type = THREE.PCFSoftShadowMap;
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
      floor(world, Math.max(scene.high[0] - scene.low[0], scene.high[1] - scene.low[1]) + 2);
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

  // Pointing -------------------------------------------------------------------------------------

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

  // Time -----------------------------------------------------------------------------------------

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

  // Over time ------------------------------------------------------------------------------------

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

  // What stands around ---------------------------------------------------------------------------

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
    worlds.forEach(function (world) {
      floor(world, Math.max(world.from.high[0] - world.from.low[0], world.from.high[1] - world.from.low[1]) + 2);
    });
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
})();
