// Before the first paint: the theme and the hand this phone's operator chose. Without a choice the phone's own theme holds.
(() => {
  try {
    const theme = localStorage.getItem('catgraph.theme');
    if (theme === 'dark' || theme === 'light') document.documentElement.dataset.theme = theme;
    if (localStorage.getItem('catgraph.hand') === 'left') document.documentElement.dataset.hand = 'left';
  } catch {
    // no storage: the phone's setting holds
  }
})();
