// Requests to the server, and the web socket that receives the session's state and sends a heartbeat every second.

const HEARTBEAT_MS = 1000;
const TIMEOUT_MS = 2500;
const RECONNECT_MS = 700;

let csrfToken = "";

export const NO_ANSWER = "The computer does not answer. Check the phone's network and try again; nothing was lost.";

// The server answered with an error.
export class RequestError extends Error {
  constructor(answer, status) {
    super(answer.message || `refused (${status})`);
    this.answer = answer;
    this.status = status;
  }
}

export async function get(path) {
  const content = await request(path, { cache: "no-store" });
  if (content.csrf_token) csrfToken = content.csrf_token;
  return content;
}

export function post(path, content = {}) {
  const headers = { "Content-Type": "application/json", "X-CSRF-Token": csrfToken };
  return request(path, { method: "POST", body: JSON.stringify(content), headers });
}

async function request(path, options) {
  const answer = await fetch(path, { ...options, signal: AbortSignal.timeout(8000) });
  const content = await answer.json().catch(() => ({}));
  if (!answer.ok) throw new RequestError(content, answer.status);
  return content;
}

export class Connection {
  constructor(onState, onStatus, onStopped) {
    this.onState = onState;
    this.onStatus = onStatus;
    this.onStopped = onStopped;
    this.receivedAt = 0;
    this.sentAt = new Map();
    this.heartbeat = 0;
    this.roundTripMs = null;
    this.connect();
    setInterval(() => this.sendHeartbeat(), HEARTBEAT_MS);
    addEventListener("online", () => this.reconnect());
    document.addEventListener("visibilitychange", () => document.hidden || this.sendHeartbeat());
  }

  get isUp() {
    return this.receivedAt > 0 && performance.now() - this.receivedAt < TIMEOUT_MS;
  }

  connect() {
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
    this.socket = socket;
    this.connectedAt = performance.now();
    socket.onmessage = (event) => {
      if (socket !== this.socket) return;
      this.receivedAt = performance.now();
      const message = JSON.parse(event.data);
      if (message.heartbeat !== undefined) this.measureRoundTrip(message.heartbeat);
      else if (message.stopped !== undefined) this.onStopped(message.stopped);
      else this.onState(message);
      this.onStatus(this);
    };
    socket.onclose = () => {
      if (socket !== this.socket) return;
      this.onStatus(this);
      setTimeout(() => socket === this.socket && this.connect(), RECONNECT_MS);
    };
  }

  reconnect() {
    const old = this.socket;
    this.connect();
    old.close();
  }

  measureRoundTrip(heartbeat) {
    const sentAt = this.sentAt.get(heartbeat);
    if (sentAt !== undefined) this.roundTripMs = performance.now() - sentAt;
    for (const earlier of [...this.sentAt.keys()]) if (earlier <= heartbeat) this.sentAt.delete(earlier);
  }

  sendHeartbeat() {
    if (this.socket.readyState === WebSocket.OPEN) {
      this.heartbeat += 1;
      this.sentAt.set(this.heartbeat, performance.now());
      this.socket.send(JSON.stringify({ heartbeat: this.heartbeat }));
    }
    // A broken connection can stay open without an error, so a silent socket is replaced.
    if (!this.isUp && performance.now() - Math.max(this.connectedAt, this.receivedAt) > 2 * TIMEOUT_MS) this.reconnect();
    this.onStatus(this);
  }

  // Sends the stop over the socket and as a request: the first to arrive stops the robot.
  stop() {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ stop: true }));
    return post("/stop");
  }
}
