// Requests to the server, or to the files of a static site: the paths are the same.

export const session = { is_static: true, csrf_token: "", author: "", title: "" };

export async function load(path) {
  const answer = await fetch(path, { cache: "no-store" });
  const content = await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Error(content.message || `${path}: ${answer.status}`);
  return content;
}

export async function start() {
  Object.assign(session, await load("data/session.json"));
}

export async function post(path, content) {
  const headers = { "Content-Type": "application/json", "X-CSRF-Token": session.csrf_token };
  const answer = await fetch(path, { method: "POST", body: JSON.stringify(content), headers });
  const said = await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Error(said.message || `refused (${answer.status})`);
  return said;
}

// Rows as objects, with the position of each.
export function objects(listed) {
  return listed.rows.map((row) => Object.fromEntries(listed.columns.map((name, i) => [name, row[i]])));
}

// Creates an element. Text is never parsed as HTML, because names in a record are not trusted.
export function make(name, fields = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(fields)) {
    if (key === "class") element.className = value;
    else if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key in element && typeof value !== "string") element[key] = value;
    else if (value !== undefined && value !== null && value !== false) element.setAttribute(key, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined && child !== ""));
  return element;
}

export const MARKS = { success: "✓", failure: "✗", void: "∅", running: "…", unjudged: "?" };

export const resultText = (row) =>
  row.failure && row.outcome === "failure" ? `failure: ${row.failure}` : row.outcome === "success" ? "success" : row.end_reason && row.outcome !== "running"
    ? `${row.outcome}: ${row.end_reason.replaceAll("_", " ")}` : row.outcome;

export const metres = (value) => (value === null ? "" : `${value.toFixed(2)} m`);
