// What was just kept, said where the thumb is, whatever comes next; for a few seconds it can be taken back there.

const at = (id) => document.getElementById(id);
const TICK_MS = 250;
let shown = null;

// The latest judgement that can still be taken back, of all those in the list; `undo(episode)` does it.
export function showKept(episodes, you, undo) {
  const latest = episodes.filter((one) => one.undo_s > 0).sort((one, other) => other.undo_s - one.undo_s)[0];
  if (!latest) return hideKept();
  const until = performance.now() + latest.undo_s * 1000; // seconds from the run: no phone's clock is asked
  const before = shown;
  shown = { one: latest, until, undo };
  const again = latest.outcome === "void" ? ": no result, its trial comes again" : ` ${latest.outcome}`;
  const words = `Kept: #${latest.episode}${again}${latest.author === you ? "" : `, says ${latest.author}`}`;
  if (at("kept-words").textContent !== words) at("kept-words").textContent = words;
  at("kept").hidden = false;
  if (!before) count();
}

export function hideKept() {
  shown = null;
  at("kept").hidden = true;
}

function count() {
  if (!shown) return;
  const left = Math.ceil((shown.until - performance.now()) / 1000);
  if (left <= 0) return hideKept();
  at("kept-undo").textContent = `Undo ${left} s`;
  setTimeout(count, TICK_MS);
}

at("kept-undo").addEventListener("click", () => {
  const { one, undo } = shown ?? {};
  hideKept();
  if (one) undo(one);
});
