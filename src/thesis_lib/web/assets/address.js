// The address of a page: what is shown stands behind its "?", beside what others keep there.
export const asked = (name) => new URLSearchParams(location.search).get(name);

export function keep(names, address, hash = location.hash) { // `address` in place of what `names` had
  const others = new URLSearchParams(location.search);
  names.forEach((name) => others.delete(name));
  const query = [address, others].filter(String).join("&");
  try {
    history.replaceState(history.state, "", `${query ? `?${query}` : location.pathname}${hash}`);
  } catch { /* some browsers refuse in a local file */ }
}
