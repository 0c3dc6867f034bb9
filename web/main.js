// Rooms, the strip above them, and when what is redrawn.

const ROOMS = ['battery', 'drive', 'setup', 'logs', 'about'];
const RENDER_MS = 250;

function enter() {
  const name = ROOMS.find((room) => '#' + room == location.hash) || ROOMS[0];
  if (name != 'drive' && stick.drives) letGo();
  for (const room of ROOMS) {
    $(room).hidden = room != name;
    const tab = document.querySelector(`nav a[href="#${room}"]`);
    if (room == name) tab.ariaCurrent = 'page';
    else tab.removeAttribute('aria-current');
  }
  document.querySelector('main').scrollTop = 0;
  if (name == 'setup') {
    readDescriptions();
    renderForms();
  }
  if (name == 'logs') listLogs();
  render();
}

function freshness() {
  const seconds = link.age / 1000;
  if (link.isFresh) return 'Live';
  if (!Number.isFinite(seconds)) return link.reached ? 'Connected, waiting for the rover' : 'Connecting to the rover…';
  return 'No word from the rover for ' + duration(seconds);
}

let wasFresh = false;
function render() {
  const { isFresh } = link;
  if (wasFresh != isFresh) say(isFresh ? 'Connected' : 'Connection lost');
  wasFresh = isFresh;
  document.body.classList.toggle('stale', !isFresh);
  show($('freshness'), freshness());
  show($('refused'), isFresh ? '' : refusal);
  const known = rover.armed != null;
  show($('armed'), known ? (rover.armed ? 'Armed' : 'Disarmed') : '');
  $('armed').className = 'chip ' + (rover.armed ? 'charging' : '');
  show($('mode'), known ? MODES[rover.mode] || 'Mode ' + rover.mode : '');
  const worst = [...rover.packs.values()].filter((pack) => pack.percent != null).sort((one, other) => one.percent - other.percent)[0];
  show($('charge'), worst ? worst.percent + ' %' : '');
  renderNotices();
  renderBattery();
  renderDrive();
  if (!$('setup').hidden) renderSetup();
  if (!$('about').hidden) renderAbout();
}

// A WebSocket does not say why it was refused, a page does: if that comes, the places are taken.
let refusal = '';
on('opened', () => {
  link.reached = true;
  refusal = '';
});
on('closed', async (wasOpen) => {
  link.reached = false;
  render();
  if (wasOpen) return;
  try {
    await fetch('/', { cache: 'no-cache' });
    refusal = 'The rover is there, and takes no further browser: two are connected already? Close one.';
  } catch {
    refusal = '';
  }
});
on('state', render);

startBattery();
startDrive();
startSetup();
startLogs();
startAbout();
addEventListener('hashchange', enter);
enter();
link.start();
setInterval(render, RENDER_MS);
