// The theme puts each block's copy button into a landmark of its own, once the page is there: each wants its own name.
const name = () =>
  document.querySelectorAll("nav.md-code__nav:not([aria-label])").forEach((nav) => {
    nav.setAttribute("aria-label", `copy ${nav.closest("pre, code, .highlight")?.id || nav.parentElement.id || "code"}`);
  });
new MutationObserver(name).observe(document.body, { childList: true, subtree: true });
name();
