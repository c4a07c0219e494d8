// A model's server for vsnbench, written from docs/wire.md with Node's standard library: node server.js [PORT [HOST]]

import { createHash, timingSafeEqual } from "node:crypto";
import { createServer } from "node:http";
import { pack, unpack } from "./msgpack.js";
import { ColourSeeker } from "./seeker.js";

const [WIRE, MAX_REQUEST, MAX_HELLO, HELLO_MS] = [2, 64 * 2 ** 20, 64 * 2 ** 10, 10_000];
const [port, host] = [Number(process.argv[2] ?? 8765), process.argv[3] ?? "127.0.0.1"];
const token = process.env.VSNBENCH_TOKEN ?? "";
const policy = new ColourSeeker();
let client = null; // one at a time
const digest = (text) => createHash("sha256").update(String(text)).digest();

function frame(socket, opcode, content) {
  const head = content.length < 126 ? Buffer.alloc(2, content.length) : Buffer.alloc(10, 127);
  if (head.length > 2) head.writeBigUInt64BE(BigInt(content.length), 2);
  head[0] = 0x80 | opcode;
  if (socket.writable) socket.write(Buffer.concat([head, content]));
}

function close(socket, error) {
  if (error) frame(socket, 2, pack({ type: "error", ...error }));
  frame(socket, 8, Buffer.alloc(0));
  socket.end();
}

function greet(socket, hello) {
  const common = hello.wire <= WIRE && (hello.newest_wire ?? hello.wire) >= WIRE;
  if (hello.type !== "hello") return close(socket, { code: "protocol", message: "the first message must be hello" });
  if (!common) return close(socket, { code: "version", message: `version ${WIRE} only` });
  const known = !token || timingSafeEqual(digest(hello.token), digest(token));
  if (!known) return close(socket, { code: "token", message: "wrong token" });
  if (client) return close(socket, { code: "busy", message: "another client is using the model" });
  client = socket;
  frame(socket, 2, pack({ type: "card", wire: WIRE, jpeg: false, card: policy.card }));
}

function answer(socket, request) {
  const { type, seq } = request;
  if (client !== socket) return greet(socket, request);
  if (type === "bye") return close(socket);
  if (!Number.isInteger(seq)) return close(socket, { code: "protocol", message: "a request without `seq`" });
  const start = performance.now();
  let response = { type: "error", code: "protocol", message: `no message ${type}` };
  try {
    if (type === "reset") response = { type: "ready", ...policy.reset(request) };
    if (type === "act") response = { type: "decision", ...policy.act(request) };
  } catch (error) {
    response = { type: "error", code: "model", message: error.message, traceback: error.stack };
  }
  frame(socket, 2, pack({ ...response, seq, seconds: (performance.now() - start) / 1000 }));
}

function nextFrame(bytes, limit) {
  const short = bytes[1] & 127;
  const at = 2 + ({ 126: 2, 127: 8 }[short] ?? 0); // where the mask begins
  if (bytes.length < at + 4) return null;
  const size = short < 126 ? short : short === 126 ? bytes.readUInt16BE(2) : Number(bytes.readBigUInt64BE(2));
  if (!(bytes[1] & 128) || size > limit) throw new Error("not a frame of a client, or too large");
  if (bytes.length < at + 4 + size) return null;
  const content = Buffer.from(bytes.subarray(at + 4, at + 4 + size));
  for (let k = 0; k < size; k++) content[k] ^= bytes[at + (k & 3)];
  return { opcode: bytes[0] & 15, last: bytes[0] & 128, content, rest: bytes.subarray(at + 4 + size) };
}

function connect(socket) {
  let [pending, parts, size, next] = [Buffer.alloc(0), [], 0, null];
  const timer = setTimeout(() => client === socket || socket.destroy(), HELLO_MS);
  socket.on("error", () => socket.destroy());
  socket.on("close", () => (clearTimeout(timer), (client = client === socket ? null : client)));
  socket.on("data", (data) => {
    pending = Buffer.concat([pending, data]);
    try {
      while ((next = nextFrame(pending, (client === socket ? MAX_REQUEST : MAX_HELLO) - size)) && socket.writable) {
        pending = next.rest;
        if (next.opcode === 1) throw new Error("a text message; every message is binary");
        if (next.opcode === 8) return close(socket);
        if (next.opcode === 9) frame(socket, 10, next.content);
        if (next.opcode > 2) continue; // a ping or a pong
        parts.push(next.content);
        size += next.content.length;
        if (!next.last) continue;
        answer(socket, unpack(Buffer.concat(parts)));
        [parts, size] = [[], 0];
      }
    } catch (error) {
      close(socket, { code: "protocol", message: error.message });
    }
  });
}

if (!token && !["127.0.0.1", "::1", "localhost"].includes(host)) throw new Error("set VSNBENCH_TOKEN");
const server = createServer((_, response) => response.writeHead(426).end());
server.on("upgrade", ({ headers }, socket) => {
  const key = `${headers["sec-websocket-key"]}258EAFA5-E914-47DA-95CA-C5AB0DC85B11`;
  const accept = `Sec-WebSocket-Accept: ${createHash("sha1").update(key).digest("base64")}`;
  socket.write(`HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n${accept}\r\n\r\n`);
  connect(socket);
});
server.listen(port, host, () => console.log(`${policy.card.name} listens at ws://${host}:${server.address().port}`));
