"use strict";
// Looks at the page from within and leaves what it finds in an element, a line each.
(() => {
  const found = { plots: 0, numbers: 0, blank: 0, unlike: 0, wide: 0, keyless: 0, unnamed: 0, failed: 0 };
  addEventListener("error", () => (found.failed += 1));

  /** Pixels with a colour: axes and grid are grey, and every plot has a line that is not. */
  const coloured = (canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let count = 0;
    for (let k = 0; k < data.length; k += 4) {
      const [red, green, blue, alpha] = data.subarray(k, k + 4);
      if (alpha > 0 && Math.max(red, green, blue) - Math.min(red, green, blue) > 60) count += 1;
    }
    return count;
  };

  const at = (document, place) => place.split("/").slice(1).reduce((value, key) => value?.[key], document);

  /** Whether a number is the document's, and reads as such up to the last digit that is shown. */
  const same = (element, document) => {
    const value = at(document, element.dataset.at);
    const shown = element.textContent.split(/\s/)[0];
    const [mantissa, exponent = "0"] = shown.split("e");
    const unit = 10 ** (Number(exponent) - (mantissa.split(".")[1] ?? "").length);
    return (
      typeof value === "number" &&
      // The page's writer reads numbers to within their last binary digit.
      Math.abs(Number(element.getAttribute("value")) - value) <= 1e-14 * Math.abs(value) &&
      Math.abs(Number(shown) - value * Number(element.dataset.factor)) <= 0.500001 * unit
    );
  };

  const press = (target, key) => target.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
  const later = () => new Promise((done) => setTimeout(done, 50));

  const look = async () => {
    const results = JSON.parse(document.getElementById("document").textContent);
    for (const element of document.querySelectorAll("data")) {
      found.numbers += 1;
      if (!same(element, results)) found.unlike += 1;
    }
    found.wide = Math.max(0, document.documentElement.scrollWidth - innerWidth);
    const named = (element) => element.textContent.trim() || element.getAttribute("aria-label");
    found.unnamed = [...document.querySelectorAll("button, a, [role=button], [tabindex]")].filter((e) => !named(e)).length;
    for (const figure of document.querySelectorAll("figure.chart")) {
      const holder = figure.querySelector(".plot");
      const canvas = figure.querySelector("canvas");
      found.plots += 1;
      if (!canvas || coloured(canvas) < 100) {
        found.blank += 1;
        continue;
      }
      const before = canvas.toDataURL();
      press(holder, "ArrowRight");
      const told = figure.querySelector(".readout").textContent;
      press(holder, "+");
      await later();
      const zoomed = canvas.toDataURL();
      press(holder, "0");
      await later();
      if (!told || zoomed === before || canvas.toDataURL() === zoomed) found.keyless += 1;
    }
  };

  addEventListener("load", () => {
    setTimeout(async () => {
      try {
        await look();
      } catch {
        found.failed += 1;
      }
      const report = document.createElement("pre");
      report.id = "page-checks";
      report.textContent = Object.entries(found).map(([key, count]) => `${key} ${count}`).join("\n");
      document.body.append(report);
    }, 200);
  });
})();
