for (const figure of document.querySelectorAll(".frames")) {
  const image = figure.querySelector("img"), slide = figure.querySelector(".slide");
  if (!image) continue;
  const {size: [width, height], places, said} = JSON.parse(figure.dataset.frames);
  const range = slide.querySelector("input"), tiles = [...slide.querySelectorAll(".tiles > div")];
  function show() {
    const k = Number(range.value);
    tiles.forEach((tile, m) => {
      const canvas = tile.querySelector("canvas"), pen = canvas.getContext("2d");
      pen.clearRect(0, 0, width, height);
      pen.drawImage(image, k * width, m * height, width, height, 0, 0, width, height);
      tile.querySelector(".value").textContent = said[m][k];
      canvas.setAttribute("aria-label", `${tile.querySelector("b").textContent}: ${said[m][k]}`);
    });
    slide.querySelector("output").textContent = places[k];
    range.setAttribute("aria-valuetext", places[k]);
  }
  image.decode().then(() => {
    figure.querySelector(".all").hidden = true;
    slide.hidden = false;
    range.addEventListener("input", show);
    show();
  });
}
