/** The 32 bytes before every `.mt*` payload (docs/formats.md). */

import { ByteReader } from './bytes.ts';
import { crc32c } from './crc32c.ts';

export const HEADER_BYTES = 32;

export type Kind = 'mtsp' | 'mti' | 'mtnc' | 'mtm' | 'mtex';

const MAGIC: Record<Kind, string> = { mtsp: 'MTSP', mti: 'MTI ', mtnc: 'MTNC', mtm: 'MTM ', mtex: 'MTEX' };
/** Bytes of an element by kind and bits. */
const ELEMENT: Record<Kind, Record<number, number>> = { mtsp: { 32: 4 }, mti: { 16: 2 }, mtnc: { 16: 2, 24: 3 }, mtm: { 8: 3 }, mtex: { 8: 3, 32: 12 } };

export interface Header {
  bits: number;
  width: number;
  height: number;
  /** D. */
  depth: number;
  /** Elements. */
  count: number;
}

/** Reads a whole file's header and gives back its payload, checked against length and checksum. */
export function openFile(bytes: Uint8Array, kind: Kind, file: string): { header: Header; payload: Uint8Array } {
  const r = new ByteReader(bytes, file);
  if (String.fromCharCode(...r.take(4, 'header')) !== MAGIC[kind]) throw r.error(`it does not begin with ${MAGIC[kind]}`);
  const version = r.u16('version');
  if (version !== 1) throw r.error(`version ${version}; this page reads version 1`);
  const bits = r.u16('bits');
  const header = { bits, width: r.u32('width'), height: r.u32('height'), depth: r.u32('depth'), count: r.u64('element count') };
  const crc = r.u32('checksum');
  const each = ELEMENT[kind][bits];
  if (!each) throw r.error(`${bits} bits per component, which no .${kind} has`);
  if (r.left !== header.count * each) throw r.error(`it has ${r.left} bytes behind its header; ${header.count * each} expected`);
  const payload = bytes.subarray(HEADER_BYTES);
  if (crc32c(payload) !== crc) throw r.error('its checksum does not fit: it is damaged, load it again');
  return { header, payload };
}
