/** Return what is written with less contrast than `least` to what it stands on (WCAG 2.2). */
(least) => {
  const numbers = (colour) => colour.match(/[\d.]+/g).map(Number);
  const linear = (level) => (level <= 0.04045 ? level / 12.92 : ((level + 0.055) / 1.055) ** 2.4);
  const luminance = (colour) => {
    const [r, g, b] = numbers(colour).map((level) => linear(level / 255));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = (element) => {
    const { backgroundColor } = getComputedStyle(element);
    const opaque = (numbers(backgroundColor)[3] ?? 1) === 1;
    return opaque || !element.parentElement ? backgroundColor : behind(element.parentElement);
  };
  const contrast = (element) => {
    const both = [getComputedStyle(element).color, behind(element)].map(luminance);
    return (Math.max(...both) + 0.05) / (Math.min(...both) + 0.05);
  };
  const writes = (element) =>
    [...element.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.data.trim());
  return [...document.querySelectorAll("body *:not(svg *):not(:disabled)")]
    .filter((element) => element.checkVisibility() && !element.closest("#picture"))
    .filter(writes)
    .map((element) => [element.textContent.trim().slice(0, 40), contrast(element)])
    .filter(([, value]) => value < least);
};
