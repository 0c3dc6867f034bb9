// Advice on texts that keep the rover from driving, and the line on low packs.

// The first that fits a text of the rover.
const ADVICE = [
  [/PARAM_CHECKED/, 'Settings were lost: look through Set up first.'],
  [/not neutral/, 'Let go of the stick.'],
  [/MOT_DRV_VOLT/, 'It may burn the motor drivers: unplug it.'],
  [/has failed|own report/, 'Do not use this pack.'],
  [/cells|contradicts/, 'Check chemistry and cells under Set up.'],
  [/over temperature/, 'Let the pack cool down.'],
  [/>=/, 'Under Set up, critical has to be below low.'],
  [/unhealthy|missing|not connected/, 'Check the plug and the wires of the pack.'],
  [/low|critical|empty|below/, 'Charge the pack, or plug in a full one.'],
  [/limits the motors/, 'It drives slower, to spare the pack. Push the stick less.'],
  [/^Radio/, 'No stick was received for too long, so it stopped. Go nearer, then choose Manual.'],
  [/^GCS/, 'No page or ground station was heard for too long, so it stopped. Go nearer, then choose Manual.'],
  [/^Terminated/, 'The pack is too low. Charge it, then restart the rover.'],
  [/Logging/, 'Its log can’t be written. Under Set up, LOG_BITMASK 0 drives without.'],
];

function advised(text) {
  const [, advice] = ADVICE.find(([pattern]) => pattern.test(text)) || [];
  return advice ? text + '. ' + advice : text;
}

// The latest text since arming on a pack's failsafe, until that has ended.
let acting = '';
// The latest text on limited power, which has no text for its end.
let limited = {};
const LIMITED_MS = 20000;

on('text', ({ text }) => {
  if (/^Battery \d (is (low|critical|missing)|unhealthy)/.test(text)) acting = text;
  if (/^Battery \d healthy/.test(text)) acting = '';
  if (/^Battery \d limits/.test(text)) limited = { text, at: now() };
});

// That text, and what it means for the driver.
function actingNow() {
  const [, pack, level] = /^Battery (\d) is (low|critical)/.exec(acting) || [];
  if (!level) return advised(acting);
  const does = levelOf(level == 'low' ? 'LOW' : 'CRT', 'BATT' + (pack > 1 ? pack : '') + '_')?.action;
  return acting + (does ? '. The rover stops to spare the pack: charge it.' : '. Nothing stops the rover: drive home, and charge the pack.');
}

// Obstacles to driving in the rover's own words, with advice.
function notices() {
  const found = [];
  if (lacksKey()) found.push('The rover has a signing key: enter it under Link.');
  if (ignored && age() > FRESH_MS) found.push('Nothing comes that is signed with your key: it is wrong, or the rover has none.');
  if (!isFresh()) return found;
  if (status == STATE_TERMINATED) found.push(advised(textLike(/^Terminated/) || 'Terminated'));
  if (status == STATE_TIMED_OUT) found.push(advised(textLike(/Failsafe: Hold$/) || 'Failsafe: Hold'));
  if (armed && acting) found.push(actingNow());
  if (armed && now() - limited.at < LIMITED_MS) found.push(advised(limited.text));
  if (ready == false && !armed) found.push(...(obstacles[0] ? obstacles : ['not ready']).map((text) => 'Does not arm: ' + advised(text)));
  return found;
}

function renderNotices() {
  const found = notices();
  for (const list of document.querySelectorAll('.notices')) {
    fill(list, found.map((text) => el('li', {}, text, /PARAM_CHECKED/.test(text) ? el('button', { onclick: () => setParameter('PARAM_CHECKED', 1) }, 'Set') : '')));
  }
}

// Action and text of a level; undefined if no threshold leads to it.
function levelOf(level, prefix) {
  const of = (name) => value(prefix + name);
  const volts = of('LOW_TIMER') && of(level + '_VOLT');
  const mah = of(level + '_MAH');
  const action = of('FS_' + level + '_ACT');
  const bounds = [volts && digits(volts, 2) + ' V for ' + of('LOW_TIMER') + ' s', mah && mah + ' mAh'].filter((bound) => bound);
  return bounds[0] && { action, text: 'Below ' + bounds.join(' or ') + (!action ? ' it only warns' : action == TERMINATE ? ' it disarms' : ' it stops in Hold') };
}

// One line on the rover's reaction to a low pack.
function whenLow() {
  const prefix = parameterOf('');
  if (!params.has(prefix + 'LOW_VOLT')) return '';
  const levels = ['LOW', 'CRT'].map((level) => levelOf(level, prefix)).filter((level) => level);
  return levels.map(({ text }) => text + '. ').join('') + (levels.some(({ action }) => action) ? '' : 'A low pack does not stop the rover.');
}
