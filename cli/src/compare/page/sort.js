// Every table is sorted by a click on a heading; cells say by data-value what by.
for (const table of document.querySelectorAll("table")) {
  const headings = [...table.tHead.rows[0].cells];
  headings.forEach((heading, column) => {
    heading.querySelector("button").addEventListener("click", () => {
      const direction = heading.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      for (const other of headings) other.removeAttribute("aria-sort");
      heading.setAttribute("aria-sort", direction === 1 ? "ascending" : "descending");
      const value = (row) => row.cells[column].dataset.value ?? "";
      const compare = (a, b) => {
        const [p, q] = [value(a), value(b)];
        // Cells without a value stay at the end, whatever the direction.
        if (p === "" || q === "") return (p === "") - (q === "");
        return direction * (column === 0 ? p.localeCompare(q) : Number(p) - Number(q));
      };
      const body = table.tBodies[0];
      body.append(...[...body.rows].sort(compare));
    });
  });
}
