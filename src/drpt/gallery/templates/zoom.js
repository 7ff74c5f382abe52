const zoom = document.getElementById("zoom");
const large = zoom.querySelector("img");
const caption = zoom.querySelector("figcaption");
document.addEventListener("click", (event) => {
  const small = event.target.closest(".picture")?.querySelector("img");
  if (!small) return;
  [large.src, large.alt, caption.textContent] = [small.src, small.alt, small.alt];
  zoom.showModal();
});
