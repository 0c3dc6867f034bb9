// The room of the logs: by HTTP, or by signed MAVLink where the rover has a key.

const DATA_BYTES = 90;
const ENTRY_MS = 1500;

const kilobytes = (bytes) => (bytes < 1e6 ? digits(bytes / 1e3, 0) + ' kB' : digits(bytes / 1e6, 1) + ' MB');

async function listByMavlink() {
  const entries = new Map();
  link.ask('LOG_REQUEST_LIST', { start: 0, end: 65535 });
  for (;;) {
    const entry = await next('LOG_ENTRY', () => true, ENTRY_MS);
    if (!entry) return entries.size ? [...entries.values()] : null;
    if (!entry.num_logs) return [];
    entries.set(entry.id, entry);
    if (entries.size == entry.num_logs) return [...entries.values()];
  }
}

async function listByHttp() {
  const answer = await fetch('/logs/', { cache: 'no-store' });
  if (!answer.ok) throw new Error((await answer.text()) || answer.statusText);
  return answer.json();
}

// The whole file; what was lost on the way is asked for again.
async function readByMavlink({ id, size }, progress) {
  const bytes = new Uint8Array(size);
  const has = new Uint8Array(Math.ceil(size / DATA_BYTES));
  let left = has.length;
  const take = ({ id: of, ofs, count, data }) => {
    const part = ofs / DATA_BYTES;
    if (of != id || has[part] !== 0) return;
    bytes.set(data.slice(0, Math.min(count, size - ofs)), ofs);
    has[part] = 1;
    left--;
    progress(1 - left / has.length);
  };
  const list = (handlers.LOG_DATA ||= []);
  list.push(take);
  for (let silent = 0; left && silent < 5;) {
    const first = has.indexOf(0);
    const end = has.indexOf(1, first);
    link.ask('LOG_REQUEST_DATA', { id, ofs: first * DATA_BYTES, count: (end < 0 ? has.length : end) * DATA_BYTES - first * DATA_BYTES });
    silent++;
    while (left && (await next('LOG_DATA', ({ id: of }) => of == id, ENTRY_MS))) silent = 0;
  }
  list.splice(list.indexOf(take), 1);
  link.ask('LOG_REQUEST_END');
  return left ? null : bytes;
}

const usesMavlink = () => !!link.signer;

async function listLogs() {
  const state = $('logs-state');
  show(state, 'Reading the list…');
  let logs = null;
  try {
    logs = usesMavlink() ? await listByMavlink() : await listByHttp();
  } catch (error) {
    show(state, 'No list: ' + error.message);
  }
  if (!logs) {
    if (usesMavlink()) show(state, 'No list: ' + (rover.armed ? 'disarm first' : NO_ANSWER));
    $('log-list').replaceChildren();
    return;
  }
  show(state, logs.length ? '' : 'There are no logs: the rover records from arming on.');
  $('log-list').replaceChildren(...logs.sort((one, other) => other.id - one.id).map(rowOf));
  $('erase').hidden = !logs.length;
}

function rowOf(log) {
  const date = log.time_utc ? new Date(log.time_utc * 1000).toLocaleString() : 'no date';
  const name = 'Log ' + log.id;
  const get = usesMavlink()
    ? el('button', { type: 'button', ariaLabel: 'Download ' + name }, 'Download')
    : el('a', { className: 'button', href: '/logs/' + log.id + '.BIN', download: '', ariaLabel: 'Download ' + name }, 'Download');
  if (usesMavlink()) get.onclick = () => save(log, get);
  return el('li', {}, el('b', {}, name), el('span', {}, date), el('span', {}, kilobytes(log.size)), get);
}

async function save(log, button) {
  button.disabled = true;
  const bytes = await readByMavlink(log, (share) => show(button, digits(share * 100, 0) + ' %'));
  button.disabled = false;
  show(button, 'Download');
  if (!bytes) return show($('logs-state'), 'The download broke off' + (rover.armed ? ': disarm first' : ''));
  const url = URL.createObjectURL(new Blob([bytes]));
  el('a', { href: url, download: 'rover-' + log.id + '.BIN' }).click();
  setTimeout(() => URL.revokeObjectURL(url), 60000);
}

function startLogs() {
  $('read-logs').onclick = listLogs;
  askTwice($('erase'), 'Erase all logs for good? Press again', async () => {
    link.ask('LOG_ERASE');
    show($('logs-state'), 'Erasing…');
    await after(1500);
    listLogs();
  });
}
