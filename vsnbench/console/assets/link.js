// The link to the run: what it says comes as it happens, a beat goes out every second, and silence is never hidden.

const BEAT_MS = 1000;
const SILENT_MS = 2500;
const AGAIN_MS = 700;

let proof = "";

export class Refused extends Error {
  constructor(answer, status) {
    super(answer.words || `refused (${status})`);
    this.answer = answer;
    this.status = status;
  }
}

export async function get(path) {
  const answer = await fetch(path, { cache: "no-store", signal: AbortSignal.timeout(8000) });
  const said = await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Refused(said, answer.status);
  if (said.proof) proof = said.proof;
  return said;
}

export async function post(path, content = {}) {
  const answer = await fetch(path, {
    method: "POST",
    body: JSON.stringify(content),
    headers: { "Content-Type": "application/json", "X-Vsnbench-Proof": proof },
    signal: AbortSignal.timeout(8000),
  });
  const said = await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Refused(said, answer.status);
  return said;
}

export class Link {
  constructor(onState, onHealth, onStopped) {
    this.onState = onState;
    this.onHealth = onHealth;
    this.onStopped = onStopped;
    this.heard = 0;
    this.sent = new Map();
    this.beat = 0;
    this.roundTripMs = null;
    this.connect();
    setInterval(() => this.pulse(), BEAT_MS);
    addEventListener("online", () => this.reconnect());
    document.addEventListener("visibilitychange", () => document.hidden || this.pulse());
  }

  get isUp() {
    return this.heard > 0 && performance.now() - this.heard < SILENT_MS;
  }

  connect() {
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
    this.socket = socket;
    this.began = performance.now();
    socket.onmessage = (event) => {
      if (socket !== this.socket) return;
      this.heard = performance.now();
      const said = JSON.parse(event.data);
      if (said.beat !== undefined) {
        const sent = this.sent.get(said.beat);
        if (sent !== undefined) this.roundTripMs = performance.now() - sent;
        for (const beat of [...this.sent.keys()]) if (beat <= said.beat) this.sent.delete(beat);
      } else if (said.stopped !== undefined) this.onStopped(said.stopped);
      else this.onState(said);
      this.onHealth(this);
    };
    socket.onclose = () => {
      if (socket !== this.socket) return;
      this.onHealth(this);
      setTimeout(() => socket === this.socket && this.connect(), AGAIN_MS);
    };
  }

  reconnect() {
    const old = this.socket;
    this.connect();
    old.close();
  }

  pulse() {
    if (this.socket.readyState === WebSocket.OPEN) {
      this.beat += 1;
      this.sent.set(this.beat, performance.now());
      this.socket.send(JSON.stringify({ beat: this.beat }));
    }
    // A socket that says nothing may be dead without knowing it: another is tried beside the waiting.
    if (!this.isUp && performance.now() - Math.max(this.began, this.heard) > 2 * SILENT_MS) this.reconnect();
    this.onHealth(this);
  }

  // Both ways at once: whichever arrives first stops the robot, the other finds it stopped.
  stop() {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ stop: true }));
    return post("/stop");
  }
}
