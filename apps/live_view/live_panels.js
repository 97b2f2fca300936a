// Everything around the view, and the stream of events that all of it comes from.

// Curves and path are drawn anew at most so often, and by default show so much of the past.
const kSlowPeriodMs = 200;
let span_s = 60;

const kFacts = [['time', 'session'], ['frames_per_s', 'frames per second'], ['latency', 'latency'], ['dropped', 'frames dropped'],
  ['keyframes', 'keyframes'], ['points', 'points'], ['loops', 'loops closed']];
const factOf = {};
for (const [name, label] of kFacts) {
  factOf[name] = h('b', {}, '–');
  $('facts').append(h('div', {class: 'fact'}, factOf[name], h('span', {}, label)));
}

function duration(seconds) {
  const two = (value) => String(Math.floor(value)).padStart(2, '0');
  return seconds < 3600 ? `${Math.floor(seconds / 60)}:${two(seconds % 60)}` :
    `${Math.floor(seconds / 3600)}:${two(seconds / 60 % 60)}:${two(seconds % 60)}`;
}

// Only what differs: the browser lays out the page anew for it.
function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function showFacts() {
  const stats = session.stats;
  const last = numFrames - 1;
  setText(factOf.time, last < 0 ? '–' : duration(frames.time_s[last]));
  setText(factOf.frames_per_s, fixed(stats.frames_per_s, 1));
  setText(factOf.latency, fixed(stats.latency_ms, 1) + ' ms');
  setText(factOf.dropped, whole(stats.dropped));
  setText(factOf.keyframes, whole(keyframes.count));
  setText(factOf.points, whole(cloud.count));
  setText(factOf.loops, whole(stats.loops));
  const state = session.isFinished ? 'finished' : last < 0 ? 'waiting for frames' : frames.state[last];
  setText($('state'), state);
  $('state').className = state;
  if (last < 0) return;
  const angle = (axis) => fixed(frames.angle_deg[axis][last], 2) + '°' +
    (frames.sigma_deg[axis][last] >= 0 ? ' ± ' + significant(frames.sigma_deg[axis][last], 2) + '°' : '');
  const position = frames.position[last];
  const rows = [['frame', whole(frames.frame[last])], ['state', frames.state[last]], ['roll', angle(0)], ['pitch', angle(1)],
    ['yaw', angle(2)], ['position', position ? position.map((value) => fixed(value, 3)).join(', ') : 'none yet'],
    ['points in view', whole(stats.points_used)]];
  const body = $('frame-facts');
  if (body.rows.length === 0) body.replaceChildren(...table(rows).children);
  rows.forEach(([, text], k) => setText(body.rows[k].cells[1], text));
}

const kNotes = {
  finished: 'The session is over. What is shown stays until the program ends.',
  lost: 'The connection to the program is lost; what is shown is what it said last.',
};
function showNote(name) {
  $('notes').replaceChildren(...(name ? [h('div', {class: 'note'}, kNotes[name])] : []));
}

let shownImage = null, isDecoding = false;
function showImage() {
  const picture = session.image;
  if (!picture || picture === shownImage || isDecoding) return;
  shownImage = picture;
  isDecoding = true;
  const image = new Image();
  image.onload = () => {
    isDecoding = false;
    paintImage(image, picture);
    showImage();
  };
  image.onerror = () => { isDecoding = false; };
  image.src = 'data:image/jpeg;base64,' + picture.jpeg;
}

function paintImage(image, picture) {
  const canvas = $('thumbnail');
  const points = decode(picture.points);
  canvas.width = Math.max(560, image.width);
  canvas.height = canvas.width * image.height / image.width;
  canvas.style.aspectRatio = `${image.width} / ${image.height}`;
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0, canvas.width, canvas.height);
  context.strokeStyle = '#35e07f';
  context.lineWidth = 1.4;
  for (let k = 0; k < points.length; k += 2) {
    context.strokeRect(points[k] / 65535 * canvas.width - 2, points[k + 1] / 65535 * canvas.height - 2, 4, 4);
  }
  setText($('picture-note'), `image of frame ${picture.frame}; ${counted(points.length / 2, 'point')} of the map`);
}

function buildCurves() {
  const spans = h('div', {id: 'spans'});
  for (const [text, seconds] of [['last 10 s', 10], ['last minute', 60], ['all', Infinity]]) {
    const button = h('button', {}, text);
    button.addEventListener('click', () => {
      span_s = seconds;
      pinnedFrame = null;
      moveTimeRange(true);
      showCurrent();
    });
    spans.append(button);
  }
  const section = panel($('panels'), 'Orientation');
  section.prepend(spans);
  ['roll', 'pitch', 'yaw'].forEach((name, axis) => new Chart(section, {title: name, unit: 'deg',
    height: axis === 2 ? 134 : 112, showTime: axis === 2, marks: () => session.correctionTimes,
    series: [{name: 'estimate', color: ['blue', 'orange', 'green'][axis], values: frames.angle_deg[axis],
      band: frames.sigma_deg[axis]}]}));
  section.append(h('p', {class: 'source'}, 'As found frame by frame. World from camera = yaw · pitch · roll; yaw turns right, ' +
    'pitch up, roll clockwise. Band: one standard deviation against the first frame. Shaded: the camera only rotates ' +
    '(orange), is at rest (violet). Violet lines: a loop has moved the map. Red ticks: too few points, carried on.'));
}

// Moves on with the newest frame, unless a part was picked by dragging; a double click shows all from then on.
let rangeSet = timeRange;
function moveTimeRange(force = false) {
  if (!force && timeRange !== rangeSet) {
    span_s = timeRange[0] <= wholeRange[0] && timeRange[1] >= wholeRange[1] ? Infinity : null;
  }
  wholeRange = findWholeRange();
  if (span_s !== null) setTimeRange(wholeRange[1] - span_s, wholeRange[1]);
  rangeSet = timeRange;
  for (const chart of charts) chart.drawSoon();
}

let view = null, setViewColors = () => {};
function buildView() {
  try {
    view = new LiveScene($('view'));
  } catch (error) {
    $('view').append(h('div', {class: 'absent'}, 'This browser shows no WebGL, which the map needs: ' + error.message));
    return;
  }
  setViewColors = addViewTools(view);
}

// What has changed since it was drawn last.
const changed = {frames: false, map: false, image: false};
let isWaiting = false, slowTime = 0;
function updateSoon() {
  if (isWaiting) return;
  isWaiting = true;
  requestAnimationFrame((now) => {
    isWaiting = false;
    update(now);
  });
}

function update(now) {
  showFacts();
  showImage();
  if (view && changed.frames) view.moveMarker();
  if (now - slowTime >= kSlowPeriodMs || session.isFinished) {
    slowTime = now;
    if (view && (changed.frames || changed.map)) view.change(changed.map);
    if (changed.frames || changed.map) {
      moveTimeRange();
      showCurrent();
    }
    changed.frames = changed.map = false;
  } else if (changed.frames || changed.map) {
    setTimeout(updateSoon, kSlowPeriodMs);
  }
}

function listen() {
  const source = new EventSource('/events');
  source.onopen = () => showNote(null);
  source.onmessage = (event) => {
    const change = takeMessage(JSON.parse(event.data));
    for (const name of Object.keys(changed)) changed[name] = changed[name] || change[name];
    if (session.isFinished) {
      source.close();
      showNote('finished');
    }
    updateSoon();
  };
  source.onerror = () => showNote('lost');
}

function redrawAll() {
  colors.clear();
  setViewColors();
  for (const chart of charts) chart.drawSoon();
}

buildView();
buildCurves();
window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redrawAll);
window.addEventListener('resize', redrawAll);
redrawAll();
showFacts();
listen();
$('foot').textContent = 'In the curves a click shows the values of a frame, dragging zooms in, a double click shows all.';
Object.assign(window.live, {frames, keyframes, cloud, session, view, charts, numFrames: () => numFrames,
  markerPosition: () => view.markerPosition(), snapshot: () => view.snapshot()});
