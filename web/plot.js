// The last ten minutes of a pack: voltage, and percentage or current. Touched, it says what was.

const PLOT_MS = 600000;
const SAMPLE_MS = 500;
const SERIES = {
  volts: { name: 'Voltage', unit: 'V', places: 2, colour: '--volts' },
  percent: { name: 'Charge', unit: '%', places: 0, colour: '--second' },
  amps: { name: 'Current', unit: 'A', places: 1, colour: '--second' },
};

let cursor = null;

on('pack', (pack) => {
  const { history, at, volts, percent, amps } = pack;
  const last = history[history.length - 1];
  if (last && at - last.at < SAMPLE_MS - 50) return;
  history.push({ at, volts, percent, amps });
  while (at - history[0].at > PLOT_MS) history.shift();
});

function limits(values, places) {
  const low = Math.min(...values);
  const high = Math.max(...values);
  const least = places == 2 ? 0.2 : places ? 1 : 10;
  const spare = Math.max(least - (high - low), (high - low) * 0.2) / 2;
  return [low - spare, high + spare];
}

function drawPlot(pack) {
  const canvas = $('plot');
  const { clientWidth: width, clientHeight: height } = canvas;
  if (!width || !pack) return;
  const scale = devicePixelRatio || 1;
  if (canvas.width != Math.round(width * scale) || canvas.height != Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const style = getComputedStyle(canvas);
  const colour = (name) => style.getPropertyValue(name);
  const pen = canvas.getContext('2d');
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = '12px system-ui,sans-serif';
  const [left, right, top, bottom] = [40, width - 40, 8, height - 22];
  const now = performance.now();
  const x = (at) => right - ((now - at) / PLOT_MS) * (right - left);
  pen.fillStyle = colour('--muted');
  pen.strokeStyle = colour('--line');
  for (let minute = 0; minute <= 10; minute += 2) {
    const place = x(now - minute * 60000);
    pen.beginPath();
    pen.moveTo(place, top);
    pen.lineTo(place, bottom);
    pen.stroke();
    pen.textAlign = minute ? 'center' : 'right';
    pen.fillText(minute ? '−' + minute + ' min' : 'now', minute ? place : right + 24, height - 6);
  }
  const second = $('plotted').value;
  const shown = [second, 'volts'];
  const at = cursor == null ? null : now - (1 - Math.min(1, Math.max(0, (cursor - left) / (right - left)))) * PLOT_MS;
  let nearest = pack.history[pack.history.length - 1];
  if (at != null) {
    for (const sample of pack.history) if (Math.abs(sample.at - at) < Math.abs(nearest.at - at)) nearest = sample;
  }
  for (const key of shown) {
    const { colour: name, places } = SERIES[key];
    const samples = pack.history.filter((sample) => sample[key] != null);
    if (!samples.length) continue;
    const [low, high] = key == 'percent' ? [0, 100] : limits(samples.map((sample) => sample[key]), places);
    const y = (value) => bottom - ((value - low) / (high - low)) * (bottom - top);
    pen.strokeStyle = pen.fillStyle = colour(name);
    pen.lineWidth = 2;
    pen.beginPath();
    let before = -Infinity;
    for (const sample of samples) {
      // A gap in what was heard is a gap in the line.
      pen[sample.at - before > 5000 ? 'moveTo' : 'lineTo'](x(sample.at), y(sample[key]));
      before = sample.at;
    }
    pen.stroke();
    pen.lineWidth = 1;
    pen.textAlign = key == 'volts' ? 'right' : 'left';
    const beside = key == 'volts' ? left - 6 : right + 6;
    for (const value of [low, high]) {
      pen.fillText(digits(value, key == 'percent' ? 0 : places ? 1 : 0), beside, y(value) + (value == low ? 0 : 10));
    }
    if (at != null && nearest[key] != null) {
      pen.beginPath();
      pen.arc(x(nearest.at), y(nearest[key]), 5, 0, 7);
      pen.fill();
    }
  }
  const said = shown.reverse().map((key) => {
    const { name, unit, places } = SERIES[key];
    return name + ' ' + (nearest[key] == null ? 'unknown' : digits(nearest[key], places) + ' ' + unit);
  });
  const when = at == null ? 'Now' : duration((now - nearest.at) / 1000) + ' ago';
  show($('reading'), when + ': ' + said.join(', '));
}

function startPlot() {
  const canvas = $('plot');
  const move = ({ offsetX }) => {
    cursor = offsetX;
    renderBattery();
  };
  canvas.onpointerdown = canvas.onpointermove = move;
  canvas.onpointerleave = () => {
    cursor = null;
    renderBattery();
  };
  canvas.onkeydown = ({ key }) => {
    const step = { ArrowLeft: -8, ArrowRight: 8 }[key];
    if (!step) return;
    cursor = Math.max(40, Math.min(canvas.clientWidth - 40, (cursor ?? canvas.clientWidth - 40) + step));
    renderBattery();
  };
  canvas.onblur = canvas.onpointerleave;
  $('plotted').onchange = $('plotted-pack').onchange = renderBattery;
}
