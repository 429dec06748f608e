for (const bar of document.querySelectorAll(".switch")) {
  const part = bar.closest("section") || document, galleries = [...part.querySelectorAll(".gallery")];
  const found = galleries.map(gallery => [...gallery.querySelectorAll("figure")]);
  const columns = found.map(figures => figures.map(figure => figure.style.getPropertyValue("--column")));
  const name = "order-" + Math.random().toString(36).slice(2);
  for (const input of bar.querySelectorAll("input")) input.name = name;
  bar.hidden = false;
  bar.addEventListener("change", event => {
    const key = event.target.value, said = [];
    found.forEach((figures, g) => {
      const value = figure => figure.dataset[key] === "" ? Infinity : Number(figure.dataset[key]);
      const sorted = key === "method" ? figures : [...figures].sort((a, b) => value(a) - value(b));
      const least = key === "method" ? 0 : value(sorted[0]);
      sorted.forEach((figure, k) => {
        figure.style.setProperty("--column", columns[g][0] ? key === "method" ? columns[g][k] : k + 2 : "");
        galleries[g].append(figure);
        const over = figure.querySelector(".over"), more = value(figure) / least - 1;
        over.textContent = key === "method" || !isFinite(more) ? "" : more ? `+${(100 * more).toPrecision(2)} %` : "least";
      });
      if (least) said.push(`${sorted[0].dataset.method} has the least`);
    });
    bar.querySelector("output").textContent = said.join("; ");
  });
}
