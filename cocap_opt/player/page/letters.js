// Names in scripts that are written from right to left.

const LETTER = "[\\u0590-\\u08ff\\ufb1d-\\ufdff\\ufe70-\\ufeff]|[\\ud802\\ud803\\ud83a\\ud83b][\\udc00-\\udfff]";
const LEFTWARDS = new RegExp(`(?:${LETTER})(?:[\\s'"´’.-]*(?:${LETTER}))*`, "g");
const MARK = "\u200e"; // invisible; what follows is written from left to right again

// The text with a mark after each such name, as numbers beside it would else be drawn on its other side.
export const inOrder = (text) => String(text).replace(LEFTWARDS, `$&${MARK}`);
