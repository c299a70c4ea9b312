// Additions to the theme for keyboards and screen readers.
addEventListener("DOMContentLoaded", () => {
  const all = (selector, change) => document.querySelectorAll(selector).forEach(change);
  all("p.caption[role=heading]", (caption) => caption.setAttribute("aria-level", "2"));
  all(".sidebar-drawer", (drawer) => drawer.setAttribute("aria-label", "All pages"));
  all(".toc-drawer", (drawer) => drawer.setAttribute("aria-label", "On this page"));
  all("pre, .table-wrapper", (box) => box.scrollWidth > box.clientWidth && (box.tabIndex = 0));
  all("th", (cell) => cell.textContent.trim() || cell.replaceWith(document.createElement("td")));
  if (!document.querySelector("h1")) {
    const title = document.createElement("h1"); // the search page has none
    title.textContent = document.title.split(" - ")[0];
    document.querySelector("[role=main]").prepend(title);
  }
});
