// The rooms, the strip above them, and when what is drawn.

let wasFresh = false;
let refusal = '';

function enter() {
  const links = [...document.querySelectorAll('nav a')];
  const entered = links.find(({ hash }) => hash == location.hash) || links[0];
  letGo();
  for (const link of links) {
    hide(link.hash.slice(1), link != entered);
    link.ariaCurrent = link == entered && 'page';
  }
  if (!$('setup').hidden) {
    readDescriptions();
    renderForms();
  }
  if (!$('logs').hidden) listLogs();
  render();
}

function render() {
  const fresh = isFresh();
  if (wasFresh != fresh) say(fresh ? 'Connected' : 'Connection lost');
  wasFresh = fresh;
  document.body.className = fresh ? '' : 'stale';
  const seen = age() < Infinity ? 'Not heard for ' + duration(age() / SECOND) : 'Connecting…';
  // As its network is named.
  const name = isIdentified && boardId() ? ', rover-' + boardId().slice(-4) : '';
  const link = delay() > SECOND && !lacksKey() ? 'Slow link' : 'Live';
  put('freshness', fresh ? link + ': rover ' + roverSystem + name : seen + ' ' + refusal);
  put('armed', armed == null ? '' : armed ? 'Armed' : 'Disarmed');
  $('armed').className = armed ? 'chip info' : 'chip';
  put('mode', armed == null ? '' : MODES[mode] || 'Mode ' + mode);
  const { percent, volts } = chosenPack();
  put('charge', (percent == null ? '' : percent + ' %  ') + (volts == null ? '' : digits(volts, 1) + ' V'));
  // Where nothing can move, Stop is quiet.
  $('stop').className = fresh && !armed ? 'quiet' : '';
  hide('while-armed', !armed);
  renderNotices();
  renderBattery();
  renderDrive();
  if (!$('setup').hidden) renderSetup();
  if (!$('about').hidden) renderAbout();
}

// A WebSocket does not say why it was refused. If the page itself comes, the places are taken.
on('closed', async (wasOpen) => {
  render();
  if (wasOpen) return;
  refusal = await fetch('/', { cache: 'no-cache' }).then(() => 'No place: two browsers are connected already?', () => '');
});
on('state', render);
// A new one at once.
on('pack', (pack) => pack.card || render());

startPlot();
startDrive();
startSetup();
startLogs();
startAbout();
onhashchange = enter;
enter();
connect();
setInterval(render, 250);
