// The room of the logs: by HTTP, or by signed MAVLink where the rover has a key.

const DATA_BYTES = 90;
const LOG_MS = 1500;

// By HTTP nothing can be signed.
async function readList() {
  if (!signer) {
    const answer = await fetch('/logs/', { cache: 'no-store' });
    if (answer.ok) return answer.json();
    throw await answer.text();
  }
  const entries = new Map();
  ask('LOG_REQUEST_LIST', { end: 65535 });
  for (;;) {
    const entry = await next('LOG_ENTRY', undefined, LOG_MS);
    if (!entry) throw armed ? 'disarm first' : NO_ANSWER;
    const { id, size, num_logs } = entry;
    if (num_logs) entries.set(id, { number: id, bytes: size, name: 'rover-' + id + '.BIN' });
    if (entries.size == num_logs) return [...entries.values()];
  }
}

// The whole file; what was lost on the way is asked for again.
async function readLog({ number: id, bytes: size }, progress) {
  const bytes = new Uint8Array(size);
  const has = Array(Math.ceil(size / DATA_BYTES)).fill(0);
  let left = has.length;
  let tries = 5;
  const isIt = (part) => part.id == id;
  const take = ({ ofs, data }) => {
    const part = ofs / DATA_BYTES;
    if (has[part] != 0) return;
    bytes.set(data.slice(0, size - ofs), ofs);
    has[part] = 1;
    progress(1 - --left / has.length);
  };
  on('LOG_DATA', (part) => isIt(part) && take(part));
  const taker = handlers.LOG_DATA.at(-1);
  while (left && tries--) {
    const first = has.indexOf(0);
    const end = has.indexOf(1, first);
    ask('LOG_REQUEST_DATA', { id, ofs: first * DATA_BYTES, count: ((end < 0 ? has.length : end) - first) * DATA_BYTES });
    while (left && (await next('LOG_DATA', isIt, LOG_MS))) tries = 5;
  }
  handlers.LOG_DATA.splice(handlers.LOG_DATA.indexOf(taker), 1);
  ask('LOG_REQUEST_END');
  return left ? null : bytes;
}

async function listLogs() {
  let logs = [];
  put('logs-state', 'Reading the list…');
  try {
    logs = await readList();
    put('logs-state', logs[0] ? '' : 'No logs: recorded from arming on.');
  } catch (error) {
    put('logs-state', 'No list: ' + error);
  }
  $('log-list').replaceChildren(...logs.reverse().map(rowOf));
  hide('erase', !logs[0]);
}

function rowOf(log) {
  const { number, bytes, name } = log;
  const label = { ariaLabel: 'Download log ' + number };
  const get = signer
    ? el('button', { ...label, onclick: () => save(log, get) }, 'Download')
    : el('a', { ...label, className: 'button', href: '/logs/' + number + '.BIN', download: name }, 'Download');
  return el('li', {}, el('b', {}, 'Log ' + number), el('span', {}, digits(bytes / 1e3) + ' kB'), get);
}

async function save(log, button) {
  button.disabled = true;
  const bytes = await readLog(log, (share) => show(button, digits(share * 100) + ' %'));
  button.disabled = false;
  show(button, 'Download');
  if (bytes) el('a', { href: URL.createObjectURL(new Blob([bytes])), download: log.name }).click();
  else put('logs-state', 'Broken off' + (armed ? ': disarm first' : ''));
}

function startLogs() {
  $('read-logs').onclick = listLogs;
  askTwice('erase', 'Press again to erase all for good', async () => {
    ask('LOG_ERASE');
    put('logs-state', 'Erasing…');
    await after(LOG_MS);
    listLogs();
  });
}
