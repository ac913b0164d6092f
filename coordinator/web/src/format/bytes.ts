/**
 * A cursor over bytes that came from outside: little-endian fields, and bincode's variable-length integers for `scene.kiln`.
 *
 * Every read is checked against what is left, so that a cut or forged file ends in a sentence that names the file and the field, never in
 * undefined behaviour further on. The alternative, trusting lengths and catching RangeError, cannot say which field was to blame.
 */

/** Bytes that are not what their format says. */
export class FormatError extends Error {
  override name = 'FormatError';
}

/** Three numbers: a position, a direction, or linear red, green and blue. */
export type Vec3 = [number, number, number];

/** Integers above this lose precision as numbers. */
const SAFE = BigInt(Number.MAX_SAFE_INTEGER);

export class ByteReader {
  private at = 0;
  private readonly view: DataView;
  readonly bytes: Uint8Array;
  private readonly file: string;

  /** `file` names the bytes in messages. */
  constructor(bytes: Uint8Array, file: string) {
    this.bytes = bytes;
    this.file = file;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }

  get position(): number {
    return this.at;
  }

  get left(): number {
    return this.bytes.length - this.at;
  }

  /** An error that names the file. */
  error(message: string): FormatError {
    return new FormatError(`${this.file}: ${message}`);
  }

  /** The next `count` bytes, not copied. */
  take(count: number, field: string): Uint8Array {
    if (count > this.left) {
      throw this.error(`it ends within its ${field}: ${count} bytes needed, ${this.left} left`);
    }
    this.at += count;
    return this.bytes.subarray(this.at - count, this.at);
  }

  skip(count: number, field: string): void {
    this.take(count, field);
  }

  u8(field: string): number {
    return this.take(1, field)[0];
  }

  u16(field: string): number {
    this.take(2, field);
    return this.view.getUint16(this.at - 2, true);
  }

  u32(field: string): number {
    this.take(4, field);
    return this.view.getUint32(this.at - 4, true);
  }

  /** A 64-bit integer that fits a number exactly. */
  u64(field: string): number {
    this.take(8, field);
    return this.safe(this.view.getBigUint64(this.at - 8, true), field);
  }

  f32(field: string): number {
    this.take(4, field);
    return this.view.getFloat32(this.at - 4, true);
  }

  bool(field: string): boolean {
    const byte = this.u8(field);
    if (byte > 1) throw this.error(`${field} is neither true nor false (${byte})`);
    return byte === 1;
  }

  vec3(field: string): Vec3 {
    return [this.f32(field), this.f32(field), this.f32(field)];
  }

  /** bincode's varint: one byte below 251, else 251, 252 or 253 before 2, 4 or 8 bytes. */
  varint(field: string): number {
    const first = this.u8(field);
    if (first < 251) return first;
    if (first === 251) return this.u16(field);
    if (first === 252) return this.u32(field);
    if (first === 253) return this.u64(field);
    throw this.error(`${field} begins with ${first}, which no integer does`);
  }

  /** A signed varint: v as 2v, below zero as -2v - 1. */
  signed(field: string): number {
    const v = this.varint(field);
    return v % 2 === 0 ? v / 2 : -(v + 1) / 2;
  }

  /** A length whose elements take at least `bytesEach` bytes: nothing is allocated on the word of a number that the file cannot keep. */
  length(bytesEach: number, field: string): number {
    const count = this.varint(field);
    if (count * bytesEach > this.left) {
      throw this.error(`${field} claims ${count} elements, for which ${this.left} bytes are too few`);
    }
    return count;
  }

  text(field: string): string {
    const bytes = this.take(this.length(1, field), field);
    return new TextDecoder().decode(bytes);
  }

  /** 0, or 1 and a value. */
  option<T>(read: () => T, field: string): T | null {
    const tag = this.u8(field);
    if (tag > 1) throw this.error(`${field} is neither there nor missing (${tag})`);
    return tag === 0 ? null : read();
  }

  /** A length and that many elements, each of at least `bytesEach` bytes. */
  list<T>(bytesEach: number, field: string, read: () => T): T[] {
    const count = this.length(bytesEach, field);
    const out: T[] = [];
    for (let i = 0; i < count; i++) out.push(read());
    return out;
  }

  /** The variant whose number comes next. */
  variant<T>(variants: readonly T[], field: string): T {
    const v = this.varint(field);
    if (v >= variants.length) throw this.error(`${field} has variant ${v}; this program knows ${variants.length}`);
    return variants[v];
  }

  /** `count` 32-bit floats, copied. */
  floats(count: number, field: string): Float32Array {
    const bytes = this.take(count * 4, field);
    const out = new Float32Array(count);
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    for (let i = 0; i < count; i++) out[i] = view.getFloat32(i * 4, true);
    return out;
  }

  /** A length and that many varints in groups of `width`, as one array. */
  varints(width: number, field: string): Uint32Array {
    const out = new Uint32Array(this.length(width, field) * width);
    for (let i = 0; i < out.length; i++) out[i] = this.varint(field);
    return out;
  }

  /** Checks that what was read is all there is. */
  end(): void {
    if (this.left !== 0) throw this.error(`${this.left} bytes follow its end`);
  }

  private safe(v: bigint, field: string): number {
    if (v > SAFE) throw this.error(`${field} is ${v}, too large for any scene`);
    return Number(v);
  }
}
