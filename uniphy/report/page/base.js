"use strict";
// What the other files share: elements, numbers, colours, and the report's own data.

// Tests read data-state and data-errors of the root element.
const root = document.documentElement;
root.dataset.state = "loading";
root.dataset.errors = "";
function fail(error) {
  root.dataset.errors += String((error && error.message) || error) + "\n";
}
window.addEventListener("error", event => fail(event.error || event.message));
window.addEventListener("unhandledrejection", event => fail(event.reason));

function element(tag, attributes, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

function svgElement(tag, attributes, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes || {})) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

function dataOf(id) {
  return JSON.parse(document.getElementById(id).textContent || "[]");
}

const superscripts = "⁰¹²³⁴⁵⁶⁷⁸⁹";
function powerOfTen(exponent) {
  const digits = String(Math.abs(exponent)).replace(/./g, digit => superscripts[digit]);
  return "10" + (exponent < 0 ? "⁻" : "") + digits;
}

/// "m^2" as m².
function withPowers(text) {
  return text.replace(/\^([0-9]+)/g, (all, digits) => digits.replace(/./g, d => superscripts[d]));
}

/// Four digits, with a power of ten where the number is large or small.
function numberText(value, digits = 4) {
  if (value === null || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e-3 && size < 1e6) return String(Number(value.toPrecision(digits)));
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
  return Number(mantissa) + "·" + powerOfTen(Number(exponent));
}

// Okabe and Ito's colours, told apart with any colour vision, as in the PNG charts.
const palette = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"];
const viridisAnchors = [0x440154, 0x482878, 0x3e4989, 0x31688e, 0x26828e,
                        0x1f9e89, 0x35b779, 0x6ece58, 0xb5de2b, 0xfde725];

/// Red, green, blue in [0, 255] at a place in [0, 1].
function viridis(place) {
  const at = Math.min(Math.max(place, 0), 1) * (viridisAnchors.length - 1);
  const k = Math.min(Math.floor(at), viridisAnchors.length - 2);
  return [16, 8, 0].map(shift => {
    const low = viridisAnchors[k] >> shift & 255, high = viridisAnchors[k + 1] >> shift & 255;
    return Math.round(low + (at - k) * (high - low));
  });
}

function rgbOf(hex) {
  const number = parseInt(hex.slice(1), 16);
  return [number >> 16 & 255, number >> 8 & 255, number & 255];
}

function viridisGradient() {
  const stops = [];
  for (let k = 0; k <= 10; ++k) stops.push(`rgb(${viridis(k / 10).join(",")}) ${10 * k}%`);
  return `linear-gradient(90deg, ${stops.join(", ")})`;
}

/// Calls `changed` when the width of an element has become another one.
function watchWidth(node, changed) {
  let width = node.clientWidth;
  new ResizeObserver(() => requestAnimationFrame(() => {
    if (node.clientWidth === width) return;
    width = node.clientWidth;
    changed();
  })).observe(node);
}

/// "#scene=1&frame=10": how the page is to open.
function hashOptions() {
  return new URLSearchParams(location.hash.slice(1));
}
