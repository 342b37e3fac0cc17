for (const viewer of document.querySelectorAll(".viewer")) {
  const all = (selector) => [...viewer.querySelectorAll(selector)];
  const mode = (name) => {
    viewer.dataset.mode = name;
    for (const button of all("[data-mode]")) button.classList.toggle("on", button.dataset.mode === name);
  };
  const choose = (name) => {
    viewer.dataset.view = name;
    for (const view of all(".view")) view.classList.toggle("on", view.dataset.view === name);
    for (const button of all("[data-choose]")) button.classList.toggle("on", button.dataset.choose === name);
  };
  for (const button of all("button[data-mode]")) button.onclick = () => mode(button.dataset.mode);
  for (const button of all("[data-choose]")) button.onclick = () => choose(button.dataset.choose);
  for (const tick of all("[data-mark]"))
    tick.onchange = () => viewer.classList.toggle("show-" + tick.dataset.mark, tick.checked);
  const slider = viewer.querySelector(".slider");
  const drag = (event) => {
    if (viewer.dataset.mode !== "swipe" || !event.buttons) return;
    const box = event.currentTarget.getBoundingClientRect();
    slider.value = 100 * (event.clientX - box.left) / box.width;
    slider.oninput();
  };
  for (const view of all(".view")) {
    view.onpointerdown = view.onpointermove = drag;
    view.ondragstart = () => false;
  }
  slider.oninput = () => viewer.style.setProperty("--at", slider.value + "%");
  setInterval(() => viewer.classList.toggle("other"), 700);
  const wanted = new URLSearchParams(location.hash.slice(1));
  mode(wanted.get("mode") || "swipe");
  choose(wanted.get("view") || "camera");
  for (const tick of all("[data-mark]"))
    if ((wanted.get("marks") || "").includes(tick.dataset.mark)) { tick.checked = true; tick.onchange(); }
}
