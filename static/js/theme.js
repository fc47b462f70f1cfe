// Before the first paint: the theme this phone's operator chose. Without a choice the phone's own setting holds.
(() => {
  try {
    const theme = localStorage.getItem('catgraph.theme');
    if (theme === 'dark' || theme === 'light') document.documentElement.dataset.theme = theme;
  } catch {
    // no storage: the phone's setting holds
  }
})();
