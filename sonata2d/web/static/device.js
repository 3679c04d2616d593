// What the device of a participant lacks for a study.

export const isTouched = matchMedia("(pointer: coarse)").matches;      // a phone or a tablet

/** The keyboard or the width that a study requires and the device lacks, in words; empty if it has both. */
export function lacking({keyboard, width}, t) {
  if (keyboard && isTouched) return t("web.needs_keyboard");
  return width && innerWidth < width ? t("web.needs_width", {width}) : "";
}
