// The part of msgpack that the wire uses: nil, bool, integers, floats, str, bin, array, map with str keys.

const NUMBERS = { 0xca: ["Float", 4], 0xcb: ["Double", 8], 0xcc: ["UInt", 1], 0xcd: ["UInt", 2], 0xce: ["UInt", 4],
  0xcf: ["BigUInt", 8], 0xd0: ["Int", 1], 0xd1: ["Int", 2], 0xd2: ["Int", 4], 0xd3: ["BigInt", 8] };
const SIZED = { 0xc4: ["bin", 1], 0xc5: ["bin", 2], 0xc6: ["bin", 4], 0xd9: ["str", 1], 0xda: ["str", 2],
  0xdb: ["str", 4], 0xdc: ["array", 2], 0xdd: ["array", 4], 0xde: ["map", 2], 0xdf: ["map", 4] };

export function unpack(buffer) {
  let at = 0;
  const take = (size) => {
    if (at + size > buffer.length) throw new Error("the message ends too early");
    at += size;
    return buffer.subarray(at - size, at);
  };
  const read = {
    bin: take,
    str: (size) => take(size).toString("utf8"),
    array: (size) => Array.from({ length: size }, () => value()),
    map: (size) => Object.fromEntries(Array.from({ length: size }, () => [value(), value()])),
  };
  const value = () => {
    const code = take(1)[0];
    if (code < 0x80) return code;
    if (code < 0x90) return read.map(code & 15);
    if (code < 0xa0) return read.array(code & 15);
    if (code < 0xc0) return read.str(code & 31);
    if (code >= 0xe0) return code - 256;
    if (code === 0xc0) return null;
    if (code === 0xc2 || code === 0xc3) return code === 0xc3;
    if (code in SIZED) return read[SIZED[code][0]](take(SIZED[code][1]).readUIntBE(0, SIZED[code][1]));
    if (!(code in NUMBERS)) throw new Error(`type ${code} is not in the protocol`);
    const [kind, size] = NUMBERS[code];
    const bits = kind === "Float" || kind === "Double" ? "" : 8 * size;
    return Number(take(size)[`read${kind}${bits}${size > 1 ? "BE" : ""}`]());
  };
  const message = value();
  if (at !== buffer.length || typeof message?.type !== "string") throw new Error("not a message");
  return message;
}

export function pack(value) {
  const head = Buffer.alloc(typeof value === "number" ? 9 : 5);
  const sized = (code, size, ...rest) => Buffer.concat([(head.writeUInt32BE(size, 1), (head[0] = code), head), ...rest]);
  if (value === null || value === undefined) return Buffer.from([0xc0]);
  if (typeof value === "boolean") return Buffer.from([value ? 0xc3 : 0xc2]);
  if (Number.isSafeInteger(value)) return head.writeBigInt64BE(BigInt(value), 1), (head[0] = 0xd3), head;
  if (typeof value === "number") return head.writeDoubleBE(value, 1), (head[0] = 0xcb), head;
  if (typeof value === "string") return sized(0xdb, Buffer.byteLength(value), Buffer.from(value));
  if (Array.isArray(value)) return sized(0xdd, value.length, ...value.map(pack));
  return sized(0xdf, Object.keys(value).length, ...Object.entries(value).flat().map(pack));
}
