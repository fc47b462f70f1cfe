// What is pressed while the page has not yet put its ears up is pressed again once it has: no tap is lost.

/** Holds every press from now on; the result presses what was held, in its order, and holds no more. @returns {() => void} */
export function holdTaps(root = document) {
  /** @type {Element[]} */
  const held = [];
  /** @param {Event} event */
  const hold = (event) => {
    event.preventDefault(); // a form is not sent by itself
    event.stopImmediatePropagation();
    if (event.target instanceof Element) held.push(event.target);
  };
  root.addEventListener('click', hold, { capture: true });
  return () => {
    root.removeEventListener('click', hold, { capture: true });
    for (const target of held) if (target.isConnected) target.dispatchEvent(new MouseEvent('click', { bubbles: true, cancelable: true }));
  };
}
