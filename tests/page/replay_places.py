"""Scripts that measure what a replay adds to the page."""

# Each with its left, right, top and bottom [px].
PLACES = """() => ['.replay-top', '.top > .chip', '.top .menu', '.replay-date', '.replay-line', '#monitor .view',
  '.time-line', '.tape-keys .clock', ...[1, 2, 3, 4, 5].map((n) => `.keysrow > :nth-child(${n})`)]
  .map((selector) => {
    const {left, right, top, bottom} = document.querySelector(selector).getBoundingClientRect();
    return [selector, left, right, top, bottom];
  })"""

# By how much a length of hours stands out of the bar [px]
LONG_ONE = """() => { const top = document.querySelector('.replay-top');
  top.querySelector('.n').textContent = '8:02:33';
  return top.scrollWidth - top.clientWidth; }"""
