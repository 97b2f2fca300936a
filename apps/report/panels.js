// Everything around the view: head, notes, curves, tables, and the transport that moves through time.

const counts = summary.counts || {};
const kFileOfPoses = hasPositions ? 'trajectory_tum.txt' : 'rotations.csv';

// Text with `names` of files set as code.
function sourceLine(...parts) {
  const line = h('p', {class: 'source'}, 'from ');
  parts.forEach((part, k) => line.append(k > 0 ? ', ' : '', h('code', {}, part)));
  return line;
}

function baseName(path) {
  const parts = String(path || '').split('/').filter((part) => part.length > 0);
  return parts.length > 0 ? parts[parts.length - 1] : '';
}

function buildHead() {
  const sequence = summary.sequence || {};
  const name = baseName(sequence.path) || baseName(data.run);
  document.title = name + ' – rotslam report';
  const head = $('head');
  head.append(h('h1', {}, name + ' ', h('small', {}, 'rotslam ' + (summary.command || 'run') + ' ' + data.version)));
  head.append(h('p', {class: 'lead'}, (sequence.description || '') + ' → ' + data.run));
  const check = data.check;
  const kClassOf = {'green': 'note', 'look at': 'note warning', 'do not use': 'note warning'};
  const verdict = h('div', {class: kClassOf[check.verdict], id: 'check'}, check.line);
  if (check.reasons.length > 0) {
    verdict.append(h('ul', {}, ...check.reasons.map((reason) =>
      h('li', {}, `${reason.frames}: ${reason.text}`))));
  }
  head.append(verdict);
  const facts = h('div', {class: 'facts'});
  const fact = (value, label) => {
    if (value !== undefined && value !== null) facts.append(h('div', {class: 'fact'}, h('b', {}, value), h('span', {}, label)));
  };
  const count = (key, label) => { if (counts[key] !== undefined) fact(whole(counts[key]), label); };
  count('frames', 'frames');
  count('keyframes', 'keyframes');
  count('points', 'points');
  count('edges', 'relative rotations');
  if (summary.loops) fact(whole(summary.loops.accepted), 'loops');
  if (counts.components > 1) count('components', 'parts of the map');
  if (data.truth) fact(significant(bestRotations().rpe1, 2) + '°', 'RPE₁');
  if (data.truth && data.truth.trajectory && data.truth.trajectory.ate !== null) {
    fact(significant(data.truth.trajectory.ate, 3), 'ATE, m');
  }
  if (summary.ba && summary.ba.median_error_px !== undefined) fact(fixed(summary.ba.median_error_px, 2) + ' px', 'median residual');
  if (summary.seconds && summary.seconds.total !== undefined) {
    const seconds = summary.seconds.total;
    fact(significant(seconds, 3) + ' s', 'in all, ' + significant(1000 * seconds / counts.frames, 3) + ' ms a frame');
  }
  head.append(facts);
}

function bestRotations() { return data.truth.trajectory || data.truth.rotations; }

// Warnings and notes above the view: what limits the accuracy of the results shown.
function buildNotes() {
  const note = (text) => $('notes').append(h('div', {class: 'note'}, text));
  const warn = (text) => $('notes').append(h('div', {class: 'note warning'}, text));
  if (!hasPositions) {
    note(summary.command === 'rotations' ?
      'Orientations only: rotslam rotations finds no positions. The view shows where the camera looked.' :
      'There are no positions: the camera only rotates, or no map was found. The view shows where the camera looked.');
  }
  if (summary.interrupted) note('The run was interrupted: the results end there.');
  const calibration = summary.calibration || {};
  if (calibration.source === 'images') {
    note(`No calibration: the lens is estimated from the images, its focal length ${significant(calibration.refined_px, 5)} px. ` +
      'Angles and shapes may be off by some tenths of a percent.');
  }
  if (calibration.source === 'guess') {
    warn('No calibration, and the images do not tell the lens: the focal length is a guess of ' +
      `${significant(calibration.refined_px, 5)} px. Angles and shapes are as wrong as it is. ` +
      'Calibrate the camera (rotslam calibrate).');
  }
  if (calibration.source === 'pure_rotation') {
    warn(`The camera only rotates if its focal length is ${significant(calibration.refined_px, 5)} px, ` +
      `not ${significant(calibration.given_px, 5)} px as its calibration says. The results use the first value.`);
  }
  if (summary.readout) {
    note(`Rolling shutter: the readout time estimated from the images is ${(1e3 * summary.readout.readout_s).toFixed(1)} ± ` +
      `${(1e3 * summary.readout.sigma_s).toFixed(1)} ms from the ${summary.camera.readout_from}; the calibration gives none.`);
  }
  if (counts.unreadable_frames) note(counted(counts.unreadable_frames, 'frame') + ' could not be read.');
  if (counts.frames_without_edge) {
    note(counted(counts.frames_without_edge, 'frame') + (counts.frames_without_edge === 1 ? ' matches' : ' match') +
      ' no other frame; the orientation there is interpolated (red ticks below the curves).');
  }
  if (counts.breaks) {
    note(counted(counts.breaks, 'time') + ' a frame matches none before it: the orientation across the gap is a guess (red ticks).');
  }
  if (counts.interpolated_frames) {
    note(counted(counts.interpolated_frames, 'position') + (counts.interpolated_frames === 1 ? ' is' : ' are') +
      ' interpolated between frames.');
  }
  const allPoints = counts.points + counts.shallow_points + counts.cloud_outliers;
  if (hasPositions && allPoints > 0 && 2 * counts.points < allPoints) {
    note(`The cloud holds ${whole(counts.points)} of ${whole(allPoints)} points: the camera has moved too little for more. Depth needs views from different places.`);
  }
  for (const segment of data.segments) {
    if (segment.scale !== 'continuity') continue;
    note(`Frames ${segment.first} to ${segment.last}: the scale of this part of the map is not measured. ` +
      'It assumes that the scene stays as far away as before (dashed in the view).');
  }
  if (summary.krot && !['converged', 'not_run'].includes(summary.krot.status)) {
    note('Known rotation: ' + summary.krot.status + (summary.krot.message ? ', ' + summary.krot.message : ''));
  }
  if (data.truth_problem) note('No comparison with the ground truth: ' + data.truth_problem);
  if (data.frame_step > 1) note(`Shown is ${everyNth(data.frame_step, 'frame')}.`);
}

function buildCharts(parent) {
  const angle = (index) => column(frames.angle_deg, 3, index);
  const sigma = (index) => column(frames.sigma_deg, 3, index);
  const truthPlaces = truth ? Array.from(truth.frame, placeOf) : [];
  const kNames = ['roll', 'pitch', 'yaw'];
  const kColors = ['blue', 'orange', 'green'];

  const orientation = panel(parent, 'Orientation');
  kNames.forEach((name, k) => {
    const series = [];
    if (truth) series.push({name: 'truth', color: 'truth', values: column(truth.angle_deg, 3, k), places: truthPlaces, dash: [5, 4]});
    series.push({name: 'estimate', color: kColors[k], values: angle(k), band: sigma(k)});
    new Chart(orientation, {title: name, unit: 'deg', series, height: k === 2 ? 134 : 112, showTime: k === 2});
  });
  orientation.append(h('p', {class: 'source'}, 'world from camera = yaw · pitch · roll; yaw turns right, pitch up, roll clockwise. ' +
    'Band: one standard deviation against the first frame.' + (truth ? ' The truth is turned as a whole to fit best.' : '')));
  orientation.append(sourceLine('rotations.csv', ...(truth ? [data.truth.file] : [])));

  if (truth) {
    const errors = panel(parent, 'Error of the orientation');
    kNames.forEach((name, k) => {
      const band = new Float32Array(truth.frame.length);
      const all = sigma(k);
      truthPlaces.forEach((place, n) => { band[n] = all[place]; });
      new Chart(errors, {title: ['about the viewing axis (roll)', 'about the right axis (pitch)', 'about the down axis (yaw)'][k],
        unit: 'deg', decimals: 3, height: k === 2 ? 134 : 112, showTime: k === 2,
        series: [{name: 'error', color: kColors[k], values: column(truth.error_deg, 3, k), places: truthPlaces, band, bandAround: 'zero'}]});
    });
    errors.append(h('p', {class: 'source'}, 'Band: one standard deviation against the first frame, as the estimate claims it. ' +
      'The error contains that of the ground truth.'), sourceLine('rotations.csv', data.truth.file));
  } else {
    const spread = panel(parent, 'Standard deviation of the orientation');
    new Chart(spread, {title: 'against the first frame', unit: 'deg', decimals: 4, fromZero: true, height: 190,
      series: kNames.map((name, k) => ({name, color: kColors[k], values: sigma(k).map((value) => Math.max(0, value))}))});
    spread.append(sourceLine('rotations.csv'));
  }

  if (hasPositions) {
    const positions = panel(parent, 'Position');
    const digits = Math.max(0, Math.min(4, 2 - Math.floor(Math.log10(extent(frames.position)))));
    ['x', 'y', 'z'].forEach((name, k) => {
      const series = [];
      if (truth && truth.position) {
        series.push({name: 'truth', color: 'truth', values: column(truth.position, 3, k), places: truthPlaces, dash: [5, 4]});
      }
      series.push({name: 'estimate', color: kColors[k], values: column(frames.position, 3, k)});
      new Chart(positions, {title: name, unit: '', series, decimals: digits, height: k === 2 ? 134 : 112, showTime: k === 2});
    });
    positions.append(h('p', {class: 'source'}, 'In the run’s own unit: the scale of one camera’s path is free.' +
      (truth && truth.position ? ' The truth is moved by the similarity that fits best.' : '')));
    positions.append(sourceLine('trajectory_tum.txt', ...(truth && truth.position ? [data.truth.file] : [])));
  }
  if (truth && truth.position_error_m) {
    const errors = panel(parent, 'Error of the position');
    new Chart(errors, {title: 'distance from the truth', unit: 'm', decimals: 3, fromZero: true, height: 190,
      series: [{name: 'error', color: 'red', values: truth.position_error_m, places: truthPlaces}]});
    errors.append(sourceLine('trajectory_tum.txt', data.truth.file));
  }

  const matching = panel(parent, 'What each frame rests on');
  const perFrame = [['edges', 'agreeing edges', 'edges', 'blue', 'rotations.csv', 0],
    ['inliers', 'matches per edge, mean', 'matches', 'green', 'map.bin', 0],
    ['tracks', 'points of the cloud in view', 'points', 'violet', 'map_all_frames.bin', 0],
    ['track_length', 'frames that see such a point, mean', 'frames', 'orange', 'map_all_frames.bin', 1]]
    .filter(([key]) => frames[key] !== undefined);
  perFrame.forEach(([key, title, name, paint, file, decimals], k) => new Chart(matching, {title, unit: '', decimals,
    fromZero: true, height: k + 1 === perFrame.length ? 122 : 100, showTime: k + 1 === perFrame.length,
    series: [{name, color: paint, values: frames[key]}]}));
  matching.append(sourceLine(...new Set(perFrame.map((entry) => entry[4]))));
}

function extent(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) { low = Math.min(low, value); high = Math.max(high, value); }
  return Math.max(1e-9, high - low);
}

function buildAccuracy(parent) {
  if (!data.truth) return;
  const columns = [['rotations_tum.txt', data.truth.rotations]];
  if (data.truth.trajectory) columns.push(['trajectory_tum.txt', data.truth.trajectory]);
  const rows = [['n', 'poses with ground truth', 0], ['rpe1', 'RPE₁, deg, root mean square', 4], ['rpe1_median', 'RPE₁ median, deg', 4],
    ['rpe1_p90', 'RPE₁ 90 percent, deg', 4], ['rpe1_max', 'RPE₁ largest, deg', 4], ['rpen', 'RPEₙ, deg, mean over all steps', 4],
    ['r_err', 'r_err, deg per 100 m', 4], ['ate', 'ATE, m, after Sim(3)', 4], ['scale', 'scale, truth / estimate', 6],
    ['path_length', 'path length, m, truth', 2]];
  const body = rows.map(([key, label, decimals]) => [label, ...columns.map(([, metrics]) => number(fixed(metrics[key], decimals)))]);
  const element = table(body, ['', ...columns.map(([name]) => number(name))]);
  element.id = 'accuracy';
  panel(parent, 'Accuracy', element, h('p', {class: 'source'}, 'The figures of ', h('code', {}, 'rotslam eval'), '.'),
    sourceLine(data.truth.file, ...columns.map(([name]) => name)));
}

// A line of pixels with the bracket on it.
function drawBracket(canvas, low, high) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const context = canvas.getContext('2d');
  context.scale(ratio, ratio);
  context.font = '11px system-ui, sans-serif';
  const most = 1.25 * high;
  const x = (value) => 12 + (width - 24) * value / most;
  context.fillStyle = color('grid');
  context.fillRect(x(0), 26, x(most) - x(0), 8);
  context.fillStyle = color('red');
  context.globalAlpha = 0.35;
  context.fillRect(x(0), 26, x(low) - x(0), 8);
  context.globalAlpha = 1;
  context.fillStyle = color('green');
  context.fillRect(x(low), 22, Math.max(3, x(high) - x(low)), 16);
  context.fillStyle = color('muted');
  context.textAlign = 'center';
  context.fillText('impossible', x(0.5 * low), 16);
  // Outwards, as the message has them.
  const [down, up] = [Math.floor(1e3 * low) / 1e3, Math.ceil(1e3 * high) / 1e3];
  context.fillText(fixed(down, 3) + ' … ' + fixed(up, 3) + ' px', Math.min(width - 60, x(0.5 * (low + high))), 16);
  const scale = ticks(0, most, width / 70);
  for (const value of scale.list) context.fillText(value.toFixed(scale.decimals), Math.min(width - 12, x(value)), 54);
}

// The lens' distortion over the distance from the principal point, with a band of one standard deviation.
function drawLens(canvas, lens) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const context = canvas.getContext('2d');
  context.scale(ratio, ratio);
  context.font = '11px system-ui, sans-serif';
  const sigma = lens.radius_px.map((_, k) => lens.sigma_px[k] || 0);
  const given = lens.given_px.filter((value) => value !== null);
  const low = Math.min(0, ...given, ...lens.displacement_px.map((value, k) => value - sigma[k]));
  const high = Math.max(0, ...given, ...lens.displacement_px.map((value, k) => value + sigma[k]));
  const margin = 0.06 * Math.max(high - low, 0.1);
  const end = lens.radius_px[lens.radius_px.length - 1];
  const x = (value) => 58 + (width - 68) * value / end;
  const y = (value) => 8 + (height - 48) * (high + margin - value) / (high - low + 2 * margin);
  context.fillStyle = color('muted');
  context.strokeStyle = color('grid');
  const line = (points) => {
    context.beginPath();
    points.forEach(([a, b], k) => (k === 0 ? context.moveTo(a, b) : context.lineTo(a, b)));
  };
  const across = ticks(0, end, width / 80), up = ticks(low - margin, high + margin, height / 45);
  context.textAlign = 'center';
  for (const value of across.list) {
    line([[x(value), 8], [x(value), height - 40]]);
    context.stroke();
    context.fillText(value.toFixed(across.decimals), x(value), height - 26);
  }
  context.fillText('distance from the principal point, px', x(0.5 * end), height - 8);
  context.textAlign = 'right';
  for (const value of up.list) {
    line([[x(0), y(value)], [x(end), y(value)]]);
    context.stroke();
    context.fillText(value.toFixed(up.decimals), 52, y(value) + 4);
  }
  const at = (values) => values.map((value, k) => [x(lens.radius_px[k]), y(value)]);
  if (lens.sigma_px.length > 0) {
    line([...at(lens.displacement_px.map((value, k) => value + sigma[k])),
      ...at(lens.displacement_px.map((value, k) => value - sigma[k])).reverse()]);
    context.globalAlpha = 0.25;
    context.fillStyle = color('blue');
    context.fill();
    context.globalAlpha = 1;
  }
  context.lineWidth = 1.6;
  context.strokeStyle = color('blue');
  line(at(lens.displacement_px));
  context.stroke();
  context.setLineDash([5, 4]);
  context.strokeStyle = color('orange');
  line(at(lens.given_px).filter((_, k) => lens.given_px[k] !== null));
  context.stroke();
}

function buildLens(parent) {
  const lens = data.lens;
  if (!lens) return;
  const canvas = h('canvas', {id: 'lens'});
  Object.assign(canvas.style, {width: '100%', height: '240px', display: 'block'});
  panel(parent, 'Lens: distortion over the image’s radius, px', canvas,
    h('p', {class: 'source'}, (lens.is_estimated ? 'Blue: the lens as the images tell it' : 'Blue: the lens as it was used') +
      (lens.sigma_px.length > 0 ? '; band: one standard deviation' : '') +
      (lens.given_px.length > 0 ? '. Dashed: the calibration.' : '.') +
      ' Distortion is how far from the place that a lens without distortion has for the same ray.'),
    sourceLine('camera.yaml', 'summary.json'));
  redraws.push(() => drawLens(canvas, lens));
}

// How far bundle adjustment's largest residual is from the least possible one, in one sentence.
function finalBracketSentence(final) {
  const kept = `After bundle adjustment the largest residual of the ${whole(final.observations)} observations that it keeps is ` +
    `${significant(final.largest_residual_px, 3)} px`;
  if (!(final.gamma_low_px > 0)) return kept + '; no lower bound is proven.';
  return kept + `; with its orientations no positions and points have one below ${significant(final.gamma_low_px, 3)} px (proven), ` +
    `and some reach ${significant(final.gamma_high_px, 3)} px.`;
}

function buildKrot(parent) {
  const krot = summary.krot;
  if (!krot) return;
  const rows = [['status', krot.status]];
  if (krot.message) rows.push(['', krot.message]);
  rows.push(['γ, normalised', `${significant(krot.gamma_low, 5)} … ${significant(krot.gamma_high, 5)}`]);
  rows.push(['γ, px', `${significant(krot.gamma_low_px, 5)} … ${significant(krot.gamma_high_px, 5)}`]);
  rows.push(['observations left out', whole(krot.removed)]);
  if (krot.programs !== undefined) rows.push(['linear programs', whole(krot.programs)]);
  const element = panel(parent, 'Known rotation: the least possible largest residual lies between');
  if (krot.gamma_high_px !== null && krot.gamma_high_px > 0) {
    const canvas = h('canvas', {class: 'bracket'});
    element.append(canvas);
    redraws.push(() => drawBracket(canvas, krot.gamma_low_px || 0, krot.gamma_high_px));
  }
  element.append(table(rows));
  if (krot.final) element.append(h('p', {}, finalBracketSentence(krot.final)));
  element.append(sourceLine('summary.json'));
}

// Nested names in one list: "loop.use" and its value.
function flat(object, prefix = '') {
  return Object.entries(object || {}).flatMap(([key, value]) =>
    (value !== null && typeof value === 'object' && !Array.isArray(value) ? flat(value, prefix + key + '.') : [[prefix + key, value]]));
}

const plain = (value) => (typeof value === 'number' ? significant(value, 6) : Array.isArray(value) ? value.map(plain).join(', ') : String(value));

function buildFigures(parent) {
  const list = (title, object) => {
    if (!object) return;
    panel(parent, title, h('div', {class: 'scroll'}, table(flat(object).map(([key, value]) => [key, number(plain(value))]))),
      sourceLine('summary.json'));
  };
  list('Counts', summary.counts);
  list('Bundle adjustment', summary.ba);
  list('Camera', summary.camera);
}

const kStages = [['lens', []], ['orientations', ['pyramid', 'tracking', 'detection', 'edges', 'averaging', 'covariance', 'loop_description',
  'loop_candidates', 'loop_verification', 'global_averaging']],
['positions', ['known_rotation', 'bundle_adjustment', 'bundle_fixed_rotation', 'bundle_coarse', 'bundle_lens', 'bundle_fine', 'bundle_final']]];

function buildTimes(parent) {
  const seconds = Object.assign({}, summary.seconds);
  const total = seconds.total || Math.max(1e-9, ...Object.values(seconds));
  const rows = [];
  const take = (key, isPart) => {
    if (seconds[key] === undefined) return;
    rows.push([key, seconds[key], isPart]);
    delete seconds[key];
  };
  for (const [stage, parts] of kStages) {
    take(stage, false);
    for (const part of parts) take(part, true);
  }
  for (const key of Object.keys(seconds)) if (key !== 'total') take(key, false);
  take('total', false);
  const element = h('table', {});
  for (const [key, value, isPart] of rows) {
    const bar = h('div', {class: 'bar'});
    bar.style.width = Math.min(100, 100 * value / total) + '%';
    bar.style.opacity = isPart ? 0.55 : 1;
    const row = h('tr', isPart ? {class: 'part'} : {}, h('td', {}, key.replaceAll('_', ' ')), h('td', {}, bar),
      h('td', {class: 'number'}, value.toFixed(2) + ' s'));
    row.children[1].style.width = '45%';
    element.append(row);
  }
  panel(parent, 'Time', element, h('p', {class: 'source'}, 'Parts are summed over threads and may exceed their stage.'),
    sourceLine('summary.json'));
}

function buildSegments(parent) {
  if (data.segments.length === 0) return;
  const rows = data.segments.map((segment) => [`${segment.first} – ${segment.last}`, segment.kind,
    segment.component < 0 ? 'none' : String(segment.component), segment.scale, number(fixed(segment.evidence, 2))]);
  const element = table(rows, ['frames', 'motion', 'part', 'scale from', number('without baseline')]);
  element.id = 'segments';
  listeners.push((place) => {
    [...element.rows].slice(1).forEach((row, k) => row.classList.toggle('current', k === segmentOf[place]));
  });
  [...element.rows].slice(1).forEach((row, k) => row.addEventListener('click', () => setFrame(placeOf(data.segments[k].first))));
  panel(parent, 'Segments', h('div', {class: 'scroll'}, element), sourceLine('segments.csv'));
}

function buildLoops(parent) {
  const accepted = data.loops.accepted;
  const rows = accepted.slice(0, 300).map((loop) => [loop.frame, loop.match, whole(loop.inliers), fixed(loop.angle_deg, 2)]
    .map((cell) => number(cell)));
  const element = panel(parent, 'Loops',
    h('p', {class: 'lead'}, data.loops.candidates === 0 ? 'No place looked like an older one.' :
      `${accepted.length} of ${counted(data.loops.candidates, 'place')} that looked like older ones ` +
      (accepted.length === 1 ? 'was' : 'were') + ' accepted' + (accepted.length > 300 ? '; the first 300:' : '.')));
  if (rows.length > 0) {
    element.append(h('div', {class: 'scroll'}, table(rows, ['frame', 'sees that of', 'matches', 'angle around, deg'].map(number))));
  }
  element.append(sourceLine('loops.csv'));
}

// The view-graph as a matrix: a dot where two frames have a relative rotation, the stronger the better known.
function drawGraph(canvas) {
  const ratio = window.devicePixelRatio || 1, side = canvas.clientWidth;
  canvas.width = canvas.height = side * ratio;
  const context = canvas.getContext('2d');
  context.scale(ratio, ratio);
  context.font = '11px system-ui, sans-serif';
  const first = 40, size = side - first - 14;
  const count = Math.max(2, frames.frame[numFrames - 1] + 1);
  const at = (frame) => first + size * (frame + 0.5) / count;
  const scale = ticks(0, count - 1, size / 70);
  context.strokeStyle = color('grid');
  context.fillStyle = color('muted');
  for (const value of scale.list) {
    context.beginPath();
    context.moveTo(at(value), first); context.lineTo(at(value), first + size);
    context.moveTo(first, at(value)); context.lineTo(first + size, at(value));
    context.stroke();
    context.textAlign = 'center'; context.textBaseline = 'alphabetic';
    context.fillText(String(value), at(value), first - 6);
    context.textAlign = 'right'; context.textBaseline = 'middle';
    context.fillText(String(value), first - 6, at(value));
  }
  const sorted = Array.from(graph.sigma_deg).sort((a, b) => a - b);
  const low = Math.log(Math.max(1e-6, sorted[Math.floor(0.05 * sorted.length)] || 1e-6));
  const high = Math.log(Math.max(1e-6, sorted[Math.floor(0.95 * sorted.length)] || 1));
  const dot = Math.max(1.3, size / count);
  context.fillStyle = color('blue');
  for (let k = 0; k < graph.sigma_deg.length; ++k) {
    const i = graph.frames[2 * k], j = graph.frames[2 * k + 1];
    const worse = (Math.log(Math.max(1e-6, graph.sigma_deg[k])) - low) / Math.max(1e-9, high - low);
    context.globalAlpha = 1 - 0.75 * Math.min(1, Math.max(0, worse));
    context.fillRect(at(i) - 0.5 * dot, at(j) - 0.5 * dot, dot, dot);
    context.fillRect(at(j) - 0.5 * dot, at(i) - 0.5 * dot, dot, dot);
  }
  context.globalAlpha = 1;
  context.strokeStyle = color('violet');
  context.lineWidth = 1.5;
  for (const loop of data.loops.accepted) {
    for (const [i, j] of [[loop.frame, loop.match], [loop.match, loop.frame]]) {
      context.beginPath();
      context.arc(at(i), at(j), Math.max(2.5, dot), 0, 7);
      context.stroke();
    }
  }
  context.strokeStyle = color('line');
  context.lineWidth = 1;
  context.strokeRect(first, first, size, size);
}

function buildGraph(parent) {
  const canvas = h('canvas', {id: 'graph'});
  canvas.style.width = '100%';
  canvas.style.maxWidth = '560px';
  canvas.style.aspectRatio = '1';
  canvas.style.display = 'block';
  const shown = graph.sigma_deg.length < graph.count ? `${whole(graph.sigma_deg.length)} of them are shown. ` : '';
  panel(parent, 'View-graph', canvas, h('p', {class: 'source'},
    `${whole(graph.count)} relative rotations between frames, stronger where better known. ${shown}` +
    (data.loops.accepted.length > 0 ? 'Rings: accepted loops.' : '')), sourceLine('view_graph.g2o', 'loops.csv'));
  redraws.push(() => drawGraph(canvas));
}

function buildOptions(parent) {
  const rows = flat(summary.options);
  const element = table(rows.map(([key, value]) => [key, number(plain(value))]));
  const filter = h('input', {class: 'filter', placeholder: 'filter, e.g. loop', 'aria-label': 'Filter the options'});
  filter.addEventListener('input', () => {
    [...element.rows].forEach((row, k) => { row.hidden = !rows[k][0].includes(filter.value.trim()); });
  });
  panel(parent, 'Options', filter, h('div', {class: 'scroll'}, element), sourceLine('summary.json'));
}

function buildFiles(parent) {
  panel(parent, 'Files of the run', h('div', {class: 'scroll'},
    table(data.files.map((file) => [h('code', {}, file.name), number((file.bytes / 1000).toFixed(1) + ' kB')]))));
}

const pictures = data.thumbnails.images;
const loaded = new Map();

// The last picture that is not newer than the frame.
function pictureOf(frame) {
  let found = -1;
  for (let k = 0; k < pictures.length && pictures[k].frame <= frame; ++k) found = k;
  return found < 0 && pictures.length > 0 ? 0 : found;
}

function showPicture(place) {
  const index = pictureOf(frames.frame[place]);
  const note = $('picture-note'), canvas = $('thumbnail');
  if (index < 0) {
    canvas.style.display = 'none';
    note.textContent = 'No image: ' + data.thumbnails.problem + '.';
    return;
  }
  const picture = pictures[index];
  const paint = (image) => {
    canvas.width = 2 * image.width;
    canvas.height = 2 * image.height;
    const context = canvas.getContext('2d');
    context.drawImage(image, 0, 0, canvas.width, canvas.height);
    if (!picture.features) return;
    const places = picture.decoded || (picture.decoded = decode(picture.features));
    context.strokeStyle = '#35e07f';
    context.lineWidth = 1.4;
    for (let k = 0; k < places.length; k += 2) {
      context.strokeRect(places[k] / 65535 * canvas.width - 2, places[k + 1] / 65535 * canvas.height - 2, 4, 4);
    }
  };
  const features = picture.features ? 'its points of the cloud (map_all_frames.bin)' : 'this run keeps no features';
  note.textContent = `image of frame ${picture.frame}; ${features}`;
  const known = loaded.get(index);
  if (known) {
    if (known.complete) paint(known);
    return;
  }
  const image = new Image();
  image.onload = () => { if (pictureOf(frames.frame[current]) === index) paint(image); };
  image.src = 'data:image/jpeg;base64,' + picture.jpeg;
  loaded.set(index, image);
}

function showFacts(place) {
  const angle = (k) => fixed(frames.angle_deg[3 * place + k], 2) + '°' +
    (frames.sigma_deg[3 * place + k] >= 0 ? ' ± ' + significant(frames.sigma_deg[3 * place + k], 2) + '°' : '');
  const rows = [['roll', angle(0)], ['pitch', angle(1)], ['yaw', angle(2)]];
  if (hasPositions) rows.push(['position', [0, 1, 2].map((k) => significant(frames.position[3 * place + k], 4)).join(', ')]);
  rows.push(['agreeing edges', whole(frames.edges[place])]);
  const segment = data.segments[segmentOf[place]];
  if (segment) rows.push(['motion', `${segment.kind}, frames ${segment.first} – ${segment.last}`]);
  const flags = kFlagNames.filter((name, k) => frames.flags[place] & (1 << k));
  rows.push(['flags', flags.length > 0 ? flags.join(', ') : 'none']);
  $('frame-facts').replaceChildren(...table(rows).children);
  $('clock').textContent = `frame ${frames.frame[place]} / ${frames.frame[numFrames - 1]}, ${fixed(frames.time_s[place], 2)} s`;
  $('slider').value = String(place);
}

function buildTransport() {
  const slider = $('slider'), play = $('play');
  slider.max = String(numFrames - 1);
  slider.addEventListener('input', () => setFrame(Number(slider.value)));
  let since = null;
  const stop = () => { since = null; play.textContent = '▶'; };
  // In the sequence's own time, at most a minute long.
  const duration = Math.min(60, Math.max(2, wholeRange[1] - wholeRange[0]));
  const step = (now) => {
    if (since === null) return;
    const share = (now - since) / 1000 / duration;
    if (share >= 1) { setFrame(numFrames - 1); stop(); return; }
    setFrame(placeAt(wholeRange[0] + share * (wholeRange[1] - wholeRange[0])));
    requestAnimationFrame(step);
  };
  const toggle = () => {
    if (since !== null) { stop(); return; }
    const from = current >= numFrames - 1 ? 0 : (frames.time_s[current] - wholeRange[0]) / (wholeRange[1] - wholeRange[0]);
    since = performance.now() - 1000 * duration * from;
    play.textContent = '⏸';
    requestAnimationFrame(step);
  };
  play.addEventListener('click', toggle);
  document.addEventListener('keydown', (event) => {
    if (event.key !== ' ' || ['INPUT', 'BUTTON'].includes(event.target.tagName)) return;
    event.preventDefault();
    toggle();
  });
}

function buildView() {
  let scene = null;
  try {
    scene = new Scene($('view'));
  } catch (error) {
    $('view').append(h('div', {class: 'absent'}, 'This browser shows no WebGL, which the map needs: ' + error.message));
    return null;
  }
  redraws.push(addViewTools(scene));
  listeners.push((place) => scene.setFrame(place));
  return scene;
}

const redraws = [];
buildHead();
buildNotes();
const view = buildView();
buildTransport();
listeners.push(showPicture, showFacts);
for (const build of [buildCharts, buildAccuracy, buildLens, buildKrot, buildSegments, buildGraph, buildLoops, buildTimes, buildFigures,
  buildOptions, buildFiles]) {
  build($('panels'));
}
$('view-hint').textContent = 'Dragging turns the view, the right button moves it, the wheel comes nearer.';
$('foot').textContent = 'In the curves a click goes to the frame, dragging zooms in, a double click shows all.';

function redrawAll() {
  colors.clear();
  for (const redraw of redraws) redraw();
  for (const chart of charts) chart.drawSoon();
}
window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redrawAll);
window.addEventListener('resize', redrawAll);
redrawAll();
setFrame(0);
Object.assign(window.report, {data, frames, setFrame, numFrames, view, charts, frame: () => current,
  markerPosition: () => view.markerPosition(), snapshot: () => view.snapshot(), ready: true});
