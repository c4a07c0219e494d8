// Keeps the keyboard focus on the same control when a part of the page is drawn again.

const ATTRIBUTES = ["data-name", "data-touched", "data-undo", "data-amend", "data-void", "data-later"];

function selectorOf(control) {
  if (control.id) return `#${CSS.escape(control.id)}`;
  const name = ATTRIBUTES.find((each) => control.hasAttribute(each));
  return name ? `[${name}="${CSS.escape(control.getAttribute(name))}"]` : "";
}

// Runs draw(), then focuses the control in `holder` that had the focus before.
export function keepFocus(holder, draw) {
  const focused = document.activeElement;
  const selector = focused && focused !== holder && holder.contains(focused) ? selectorOf(focused) : "";
  draw();
  if (!selector || focused.isConnected) return;
  holder.querySelector(selector)?.focus({ preventScroll: true });
}
