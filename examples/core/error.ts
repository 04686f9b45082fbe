/** A file that cannot be used. The message says what is wrong and what to do, in plain English. */
export class FileError extends Error {
  override name = "FileError";
}

/** Refuse a file unless a condition holds. */
export function check(holds: unknown, message: string): asserts holds {
  if (!holds) throw new FileError(message);
}
