// The last ten minutes of a pack: voltage, and charge or current. Touched, it says what was.

const PLOT_MS = 600000;
const SAMPLE_MS = 450;
const CHARGE = ['Charge', 0, ' %'];
// The least that the height spans.
const SPANS = { volts: 0.2, amps: 1 };

// From 0, ten minutes ago, to 1, now.
let cursor = 1;

on('pack', ({ history, at, volts, percent, amps, SIGMA }) => {
  if (at - history.at(-1)?.at < SAMPLE_MS) return;
  history.push({ at, volts, percent, amps, SIGMA });
  while (at - history[0].at > PLOT_MS) history.shift();
});

function drawPlot({ history }) {
  const start = now() - PLOT_MS;
  const at = start + cursor * PLOT_MS;
  const far = (sample) => Math.abs(sample.at - at);
  const nearest = history.reduce((one, other) => (far(other) < far(one) ? other : one));
  const said = ['volts', $('plotted').value].map((key, index) => {
    const [name, places, unit] = FIGURES[key] || CHARGE;
    const figure = (number) => digits(number, places) + unit;
    const points = history.filter((sample) => sample[key] != null);
    const heights = points.map((sample) => sample[key]);
    const [low, high] = [Math.min(...heights), Math.max(...heights)];
    const span = Math.max(SPANS[key] || 100, high - low);
    const x = (time) => (time - start) / PLOT_MS * 600;
    const bottom = SPANS[key] ? (low + high - span) / 2 : 0;
    const y = (number) => 100 - (number - bottom) / span * 100;
    let last;
    // What is not sure of the charge: two standard deviations to both sides.
    let band = '';
    // A gap in what was heard is a gap in the line.
    const path = points.map((sample) => {
      const isGap = !(sample.at - last < DEAD_MS);
      last = sample.at;
      const { percent, SIGMA } = sample;
      if (key == 'percent' && SIGMA != null) band += 'M' + x(last) + ' ' + y(percent - 2 * SIGMA) + 'V' + y(percent + 2 * SIGMA);
      return (isGap ? 'M' : 'L') + x(last) + ' ' + y(sample[key]);
    });
    $('plot').children[index].setAttribute('d', path.join(''));
    $('plot').children[2].setAttribute('d', 'M' + x(nearest.at) + ' 0V100');
    $('plot').children[3].setAttribute('d', band);
    // A number at each line of the grid.
    put('range' + index, path[0] ? [4, 3, 2, 1, 0].map((quarter) => figure(bottom + span * quarter / 4)).join('\n') : '');
    return name + ' ' + (nearest[key] == null ? 'unknown' : figure(nearest[key]));
  });
  put('reading', (cursor < 1 ? duration((now() - nearest.at) / SECOND) + ' ago' : 'Now') + ': ' + said.join(', '));
}

function startPlot() {
  const plot = $('plot');
  const read = (place) => {
    cursor = Math.max(0, Math.min(1, place));
    renderBattery();
  };
  plot.onpointerdown = plot.onpointermove = (event) => read((event.clientX - plot.getBoundingClientRect().left) / plot.clientWidth);
  plot.onpointerleave = plot.onblur = () => read(1);
  plot.onkeydown = ({ key }) => read(cursor + ({ ArrowLeft: -0.02, ArrowRight: 0.02 }[key] || 0));
}
