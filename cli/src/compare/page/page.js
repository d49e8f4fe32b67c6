"use strict";
(() => {
  const byId = (id) => document.getElementById(id);
  const images = [...document.querySelectorAll("img[data-label]")];
  const [left, right, at, zoom] = ["left", "right", "at", "zoom"].map(byId);
  const [under, over, stage, viewport, divider, readout] =
    ["under", "over", "stage", "viewport", "divider", "readout"].map(byId);

  // --- the slider -----------------------------------------------------------------------------------------

  for (const select of [left, right]) {
    for (const image of images) {
      select.add(new Option(image.dataset.label, image.id));
    }
  }

  // The address after '#': left=…&right=…&at=…&zoom=…
  const readHash = () => {
    const hash = new URLSearchParams(location.hash.slice(1));
    const pick = (select, name, fallback) => {
      const id = hash.get(name);
      select.value = images.some((image) => image.id === id) ? id : fallback;
    };
    const second = images.find((image) => image.dataset.run !== images[0].dataset.run && image.dataset.kind === "shaded");
    pick(left, "left", images[0].id);
    pick(right, "right", (second ?? images[images.length - 1]).id);
    const position = Number.parseFloat(hash.get("at"));
    at.value = Number.isFinite(position) ? Math.min(100, Math.max(0, position)) : 50;
    zoom.value = ["1", "2", "4", "8"].includes(hash.get("zoom")) ? hash.get("zoom") : "0";
  };

  const writeHash = () => {
    const hash = new URLSearchParams({ left: left.value, right: right.value, at: at.value, zoom: zoom.value });
    history.replaceState(null, "", `#${hash}`);
  };

  const show = () => {
    const [a, b] = [byId(left.value), byId(right.value)];
    // The left image lies above and is cut off at the divider.
    over.src = a.src;
    over.alt = `Left: ${a.alt}`;
    under.src = b.src;
    under.alt = `Right: ${b.alt}`;
    const factor = Number(zoom.value);
    stage.style.width = factor ? `${images[0].naturalWidth * factor}px` : "100%";
    // "Fit" grows small images by whole pixels only as far as the window allows.
    stage.style.maxWidth = factor ? "none" : `calc(85vh * ${images[0].naturalWidth / images[0].naturalHeight})`;
    over.style.clipPath = `inset(0 ${100 - at.value}% 0 0)`;
    divider.style.left = `${at.value}%`;
    at.setAttribute("aria-valuetext", `${Math.round(at.value)} % of ${a.dataset.label}, the rest ${b.dataset.label}`);
  };

  const changed = () => {
    show();
    writeHash();
  };
  for (const input of [left, right, zoom]) input.addEventListener("change", changed);
  at.addEventListener("input", changed);
  byId("swap").addEventListener("click", () => {
    [left.value, right.value] = [right.value, left.value];
    changed();
  });
  addEventListener("hashchange", () => {
    readHash();
    show();
  });

  const share = (event) => {
    const box = stage.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  };
  let dragging = false;
  const drag = (event) => {
    at.value = Math.min(100, Math.max(0, share(event)[0] * 100));
    changed();
  };
  stage.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    dragging = true;
    stage.setPointerCapture(event.pointerId);
    drag(event);
  });
  stage.addEventListener("pointermove", (event) => {
    if (dragging) drag(event);
    tell(event);
  });
  for (const name of ["pointerup", "pointercancel"]) stage.addEventListener(name, () => (dragging = false));

  // --- visibilities under the pointer ---------------------------------------------------------------------

  const pixels = new Map();
  const visibilityAt = (run, x, y) => {
    if (!pixels.has(run)) {
      const image = images.find((image) => image.dataset.run === run && image.dataset.kind === "visibility");
      const canvas = document.createElement("canvas");
      [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
      const context = canvas.getContext("2d", { willReadFrequently: true });
      context.drawImage(image, 0, 0);
      pixels.set(run, context.getImageData(0, 0, canvas.width, canvas.height));
    }
    const { data, width } = pixels.get(run);
    const i = 4 * (y * width + x);
    return data[i + 3] === 0 ? null : data[i] / 255;
  };

  const tell = (event) => {
    const [u, v] = share(event);
    const x = Math.floor(u * images[0].naturalWidth);
    const y = Math.floor(v * images[0].naturalHeight);
    if (x < 0 || y < 0 || x >= images[0].naturalWidth || y >= images[0].naturalHeight) return;
    const truth = visibilityAt(images[0].dataset.run, x, y);
    if (truth === null) {
      readout.textContent = `Pixel (${x}, ${y}): nothing is seen`;
      return;
    }
    const parts = [`Pixel (${x}, ${y}): ground truth V ${truth.toFixed(2)}`];
    const runs = new Set([left.value, right.value].map((id) => byId(id).dataset.run));
    for (const run of runs) {
      if (run === images[0].dataset.run) continue;
      const value = visibilityAt(run, x, y);
      const name = images.find((image) => image.dataset.run === run).dataset.name;
      if (value !== null) {
        const error = value - truth;
        parts.push(`${name} V ${value.toFixed(2)}, error ${error < 0 ? "−" : "+"}${Math.abs(error).toFixed(2)}`);
      }
    }
    readout.textContent = parts.join("; ");
  };

  Promise.all(images.map((image) => image.decode().catch(() => {}))).then(() => {
    readHash();
    show();
    byId("slider").hidden = false;
  });
})();
