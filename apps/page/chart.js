// Curves over time on canvases that share one time axis: a click goes to the frame, dragging zooms in, a double click
// shows all. The wheel zooms with Ctrl alone, so that the page scrolls. The page has `frames` (time_s, flags),
// `numFrames`, `data.segments`, `placeOf`, `current`, `setFrame` and `listeners`.

const kMargin = {left: 58, right: 10, top: 8, bottom: 22};
const charts = [];
let wholeRange = findWholeRange();
let timeRange = wholeRange.slice();

function findWholeRange() {
  if (numFrames === 0) return [0, 1];
  return [frames.time_s[0], Math.max(frames.time_s[numFrames - 1], frames.time_s[0] + 1e-6)];
}

function setTimeRange(begin, end) {
  const all = wholeRange[1] - wholeRange[0];
  const span = Math.min(all, Math.max(end - begin, all / Math.max(1, numFrames)));
  const least = Math.min(wholeRange[1] - span, Math.max(wholeRange[0], begin));
  timeRange = [least, least + span];
  for (const chart of charts) chart.drawSoon();
}

// Round steps, so that about `count` fit between the ends.
function ticks(low, high, count) {
  const rough = (high - low) / Math.max(1, count);
  const power = Math.pow(10, Math.floor(Math.log10(rough)));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((value) => value >= rough);
  const list = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) list.push(k * step);
  return {list, decimals: Math.max(0, -Math.floor(Math.log10(step) + 1e-9))};
}

// The last place whose time is not beyond `time`.
function placeAt(time) {
  let low = 0, high = numFrames - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (frames.time_s[middle] <= time) low = middle;
    else high = middle - 1;
  }
  return low + 1 < numFrames && frames.time_s[low + 1] - time < time - frames.time_s[low] ? low + 1 : low;
}

// A line of which no more is drawn than a column of pixels can show: its first, lowest, highest and last point.
class ThinnedLine {
  constructor(context) {
    this.context = context;
    this.column = null;
  }
  from(x, y) {
    this.end();
    this.context.moveTo(x, y);
  }
  to(x, y) {
    if (this.column !== Math.floor(x)) {
      this.end();
      this.column = Math.floor(x);
      this.low = this.high = y;
      this.context.lineTo(x, y);
    }
    this.low = Math.min(this.low, y);
    this.high = Math.max(this.high, y);
    this.last = [x, y];
  }
  end() {
    if (this.column === null) return;
    if (this.high > this.low) {
      this.context.lineTo(this.last[0], this.low);
      this.context.lineTo(this.last[0], this.high);
      this.context.lineTo(...this.last);
    }
    this.column = null;
  }
}

class Chart {
  // series: {name, color, values, [places], [band: half widths, negative where unknown], [bandAround: 'zero'], [dash], [dots]}
  // `places` says which frames the values belong to, where that is not all of them. `marks()` are times of events.
  constructor(parent, {title, unit, series, height = 130, showTime = true, fromZero = false, decimals = 2, marks = () => []}) {
    Object.assign(this, {width: 0, series, height, showTime, fromZero, unit, decimals, marks});
    this.head = h('div', {class: 'chart-head'}, h('b', {}, title + (unit ? ', ' + unit : '')));
    this.values = series.map((item) => {
      const mark = h('i', {});
      const value = h('span', {});
      this.head.append(h('span', {}, mark, value));
      return {mark, value};
    });
    this.canvas = h('canvas', {});
    this.cursor = h('div', {class: 'cursor'});
    this.selection = h('div', {class: 'selection'});
    this.box = h('div', {class: 'chart'}, this.canvas, this.selection, this.cursor);
    parent.append(this.head, this.box);
    this.bottom = showTime ? kMargin.bottom : 6;
    charts.push(this);
    listeners.push(() => this.showCursor());
    this.listen();
    for (const item of series) {
      if (!item.places) continue;
      item.at = new Int32Array(numFrames).fill(-1);
      item.places.forEach((place, k) => { item.at[place] = k; });
    }
    new ResizeObserver(() => this.drawSoon()).observe(this.box);
  }

  listen() {
    const timeOf = (event) => {
      const x = event.clientX - this.box.getBoundingClientRect().left;
      return timeRange[0] + (timeRange[1] - timeRange[0]) * (x - kMargin.left) / this.plotWidth();
    };
    this.box.addEventListener('wheel', (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      const factor = Math.exp(0.0015 * event.deltaY);
      const time = timeOf(event);
      setTimeRange(time - (time - timeRange[0]) * factor, time + (timeRange[1] - time) * factor);
    }, {passive: false});
    let start = null;
    this.box.addEventListener('pointerdown', (event) => {
      start = {x: event.clientX, time: timeOf(event)};
      this.box.setPointerCapture(event.pointerId);
    });
    this.box.addEventListener('pointermove', (event) => {
      if (start) this.showSelection(this.x(start.time), this.x(timeOf(event)));
    });
    this.box.addEventListener('pointerup', (event) => {
      if (!start) return;
      const time = timeOf(event);
      if (Math.abs(event.clientX - start.x) > 6) setTimeRange(Math.min(time, start.time), Math.max(time, start.time));
      else setFrame(placeAt(time));
      start = null;
      this.selection.style.display = 'none';
    });
    this.box.addEventListener('dblclick', () => setTimeRange(...wholeRange));
  }

  showSelection(from, to) {
    Object.assign(this.selection.style, {display: 'block', left: Math.min(from, to) + 'px', top: kMargin.top + 'px',
      width: Math.abs(to - from) + 'px', height: this.plotHeight() + 'px'});
  }

  plotWidth() { return Math.max(10, this.width - kMargin.left - kMargin.right); }
  plotHeight() { return this.height - kMargin.top - this.bottom; }
  x(time) { return kMargin.left + this.plotWidth() * (time - timeRange[0]) / (timeRange[1] - timeRange[0]); }
  y(value) { return kMargin.top + this.plotHeight() * (this.high - value) / (this.high - this.low); }

  drawSoon() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  // Calls with place, value and half width of the band for what the time range shows, and a neighbour on each side.
  visit(item, action) {
    const count = item.places ? item.places.length : numFrames;
    const placeOfIndex = (k) => (item.places ? item.places[k] : k);
    for (let k = 0; k < count; ++k) {
      const place = placeOfIndex(k);
      if (k + 1 < count && frames.time_s[placeOfIndex(k + 1)] < timeRange[0]) continue;
      const band = item.band && item.band[k] >= 0 ? item.band[k] : 0;
      action(place, item.values[k], band, k);
      if (frames.time_s[place] > timeRange[1]) break;
    }
  }

  findRange() {
    let low = this.fromZero ? 0 : Infinity, high = -Infinity;
    for (const item of this.series) {
      this.visit(item, (place, value, band) => {
        const middle = item.bandAround === 'zero' ? 0 : value;
        low = Math.min(low, value, middle - band);
        high = Math.max(high, value, middle + band);
      });
    }
    if (!(high > low)) { low -= 0.5; high = low + 1; }
    const pad = 0.06 * (high - low);
    this.low = this.fromZero ? low : low - pad;
    this.high = high + pad;
  }

  draw() {
    const width = this.width = this.box.clientWidth;
    if (width === 0) return;
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(this.height * ratio);
    this.canvas.style.height = this.height + 'px';
    const context = this.canvas.getContext('2d');
    context.scale(ratio, ratio);
    context.font = '11px system-ui, sans-serif';
    this.findRange();
    this.drawBackground(context);
    context.save();
    context.beginPath();
    context.rect(kMargin.left, 0, this.plotWidth(), this.height - this.bottom + 2);
    context.clip();
    for (const item of this.series) this.drawSeries(context, item);
    context.restore();
    this.series.forEach((item, k) => { this.values[k].mark.style.background = color(item.color); });
    this.showCursor();
  }

  drawBackground(context) {
    const bottom = kMargin.top + this.plotHeight();
    const right = kMargin.left + this.plotWidth();
    for (const segment of data.segments) {
      if (!kKinds[segment.kind]) continue;
      const begin = Math.max(kMargin.left, this.x(frames.time_s[placeOf(segment.first)]));
      const end = Math.min(right, this.x(frames.time_s[placeOf(segment.last)]));
      if (end < begin) continue;
      context.fillStyle = color(segment.kind === 'still' ? 'rest' : 'turn');
      context.fillRect(begin, kMargin.top, Math.max(1, end - begin), bottom - kMargin.top);
    }
    context.fillStyle = color('violet');
    for (const time of this.marks()) {
      const x = this.x(time);
      if (x >= kMargin.left && x <= right) context.fillRect(x - 0.75, kMargin.top, 1.5, bottom - kMargin.top);
    }
    context.fillStyle = color('red');
    for (let k = 0; k < numFrames; ++k) {
      if (!(frames.flags[k] & (kPredicted | kBreak))) continue;
      const x = this.x(frames.time_s[k]);
      if (x >= kMargin.left && x <= right) context.fillRect(x - 0.75, bottom - 6, 1.5, 6);
    }
    context.strokeStyle = color('grid');
    context.fillStyle = color('muted');
    context.lineWidth = 1;
    context.textBaseline = 'middle';
    context.textAlign = 'right';
    const values = ticks(this.low, this.high, this.plotHeight() / 22);
    for (const value of values.list) {
      const y = Math.round(this.y(value)) + 0.5;
      context.beginPath();
      context.moveTo(kMargin.left, y);
      context.lineTo(right, y);
      context.stroke();
      context.fillText(value.toFixed(values.decimals), kMargin.left - 7, y);
    }
    if (!this.showTime) return;
    context.textAlign = 'center';
    context.textBaseline = 'alphabetic';
    const times = ticks(timeRange[0], timeRange[1], this.plotWidth() / 75);
    for (const time of times.list) {
      const x = this.x(time);
      if (x > right - 22) continue;
      context.fillText(time.toFixed(times.decimals), x, this.height - 6);
    }
    context.textAlign = 'right';
    context.fillText('s', right, this.height - 6);
  }

  drawSeries(context, item) {
    const paint = color(item.color);
    const draw = new ThinnedLine(context);
    if (item.band) {
      const upper = [], lower = [];
      let column = -1;
      this.visit(item, (place, value, band) => {
        const middle = item.bandAround === 'zero' ? 0 : value;
        const x = this.x(frames.time_s[place]);
        const high = this.y(middle + band), low = this.y(middle - band);
        if (Math.floor(x) === column) {
          upper[upper.length - 1][1] = Math.min(upper[upper.length - 1][1], high);
          lower[lower.length - 1][1] = Math.max(lower[lower.length - 1][1], low);
          return;
        }
        column = Math.floor(x);
        upper.push([x, high]);
        lower.push([x, low]);
      });
      context.beginPath();
      for (const [x, y] of upper) context.lineTo(x, y);
      for (const [x, y] of lower.reverse()) context.lineTo(x, y);
      context.globalAlpha = 0.2;
      context.fillStyle = paint;
      context.fill();
      context.globalAlpha = 1;
    }
    context.strokeStyle = paint;
    context.lineWidth = 1.4;
    context.setLineDash(item.dash || []);
    context.beginPath();
    let last = -2;
    this.visit(item, (place, value) => {
      const x = this.x(frames.time_s[place]), y = this.y(value);
      if (place === last + 1) draw.to(x, y);
      else draw.from(x, y);
      last = place;
    });
    draw.end();
    context.stroke();
    context.setLineDash([]);
  }

  showCursor() {
    const x = this.x(frames.time_s[current]);
    const visible = x >= kMargin.left && x <= kMargin.left + this.plotWidth();
    Object.assign(this.cursor.style, {display: visible ? 'block' : 'none', left: x + 'px', top: kMargin.top + 'px',
      height: this.plotHeight() + 'px'});
    this.series.forEach((item, k) => {
      const index = item.at ? item.at[current] : current;
      let text = item.name + ' ' + (index < 0 ? '–' : fixed(item.values[index], this.decimals));
      if (index >= 0 && item.band) text += item.band[index] >= 0 ? ' ± ' + significant(item.band[index], 2) : '';
      this.values[k].value.textContent = text;
    });
  }
}
