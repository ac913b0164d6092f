/** Figures and times as people read them. Everything is written the same in every language, so that pages and screenshots compare. */

const PREFIXES = ['', 'k', 'M', 'G', 'T', 'P'];

/** Three significant digits with a decimal prefix: `1.23 M`. */
export function short(value: number): string {
  if (!Number.isFinite(value)) return '–';
  let n = value;
  let p = 0;
  while (Math.abs(n) >= 999.5 && p < PREFIXES.length - 1) {
    n /= 1000;
    p++;
  }
  const digits = Math.abs(n) >= 99.95 ? 0 : Math.abs(n) >= 9.995 ? 1 : 2;
  const text = p === 0 && Number.isInteger(n) ? `${n}` : n.toFixed(digits);
  return p === 0 ? text : `${text} ${PREFIXES[p]}`;
}

/** A count per second: `1.23 M/s`, or a dash where nothing happens. */
export const rate = (perSecond: number | null | undefined): string => (perSecond ? `${short(perSecond)}/s` : '–');

/** Bytes with a binary prefix: `1.5 MiB`. */
export function bytes(value: number): string {
  if (value < 1024) return `${value} B`;
  let n = value / 1024;
  let p = 0;
  const units = ['KiB', 'MiB', 'GiB', 'TiB'];
  while (n >= 1023.95 && p < units.length - 1) {
    n /= 1024;
    p++;
  }
  return `${n.toFixed(1)} ${units[p]}`;
}

/** Whole percent, rounded down: 100 % is said of what is complete, and of nothing else. */
export const percent = (fraction: number): string => `${Math.floor(Math.min(1, Math.max(0, fraction)) * 100 + 1e-9)} %`;

/** `42 s`, `3 min 20 s`, `2 h 5 min`. */
export function duration(seconds: number): string {
  const s = Math.max(0, Math.round(seconds));
  if (s < 60) return `${s} s`;
  if (s < 3600) return s % 60 ? `${Math.floor(s / 60)} min ${s % 60} s` : `${s / 60} min`;
  const h = Math.floor(s / 3600);
  const min = Math.floor((s % 3600) / 60);
  return min ? `${h} h ${min} min` : `${h} h`;
}

/** Local time of day, `HH:MM:SS`. */
export function clockTime(ms: number): string {
  const d = new Date(ms);
  return [d.getHours(), d.getMinutes(), d.getSeconds()].map((n) => String(n).padStart(2, '0')).join(':');
}

/** Local date and time, `YYYY-MM-DD HH:MM`. */
export function dateTime(ms: number): string {
  const d = new Date(ms);
  const date = [d.getFullYear(), d.getMonth() + 1, d.getDate()].map((n) => String(n).padStart(2, '0')).join('-');
  return `${date} ${clockTime(ms).slice(0, 5)}`;
}

/** A radiance to four significant digits. */
export function radiance(value: number): string {
  return value === 0 ? '0' : Math.abs(value) >= 1e4 || Math.abs(value) < 1e-3 ? value.toExponential(2) : String(Number(value.toPrecision(4)));
}
