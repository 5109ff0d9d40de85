/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The kind of a file, by its content: a command that is given one of another kind names that
 * kind and the command that reads it.
 */
#ifndef INCISE_FILE_KIND_H
#define INCISE_FILE_KIND_H

/* Bits, so that a command can expect several. */
enum file_kind {
	FILE_UNKNOWN = 0,
	FILE_RECORDING = 1 << 0, /* a folder with recording.db */
	FILE_MODEL = 1 << 1,	 /* .fis */
	FILE_COMPILED = 1 << 2,	 /* .fx */
	FILE_PLAN = 1 << 3,	 /* a compiled scene */
	FILE_SCENE = 1 << 4,
	FILE_RIG = 1 << 5,	   /* rig.conf */
	FILE_CALIBRATION = 1 << 6, /* calibration.conf */
	FILE_TABLE = 1 << 7,	   /* CSV with commas */
	FILE_SESSION = 1 << 8,
	FILE_REPORT = 1 << 9,	   /* any other JSON */
	FILE_STATE = 1 << 10,	   /* the state page of a loop */
	FILE_DEVIATION = 1 << 11,  /* .sd */
	FILE_IMAGE = 1 << 12,	   /* PNG, JPEG, PGM or PPM */
	FILE_VIDEO = 1 << 13,	   /* Matroska */
	FILE_EXPORT = 1 << 14,	   /* of a recording; one in CSV is a table */
	FILE_DATABASE = 1 << 15,   /* SQLite */
	FILE_SEMICOLONS = 1 << 16, /* a table that is no CSV: its separator */
	FILE_TABS = 1 << 17,
	FILE_FACTOR = 1 << 18,	/* .fac */
	FILE_TEXTURE = 1 << 19, /* .tex */
	FILE_KINDS = 20,
};

/*
 * The path of a file or folder without the choice of a joined recording, "day.rec" of "day.rec:a"
 * if only that exists: free(3).
 */
char *file_without_choice(const char *path);

/* FILE_UNKNOWN also where there is no such file, or none that may be read. */
enum file_kind file_kind_of(const char *path);

/*
 * Fail the program if @path is recognised as a kind that is none of @expected, or if there is
 * no such file but one whose name is near. Does nothing for "-", a device, a missing file or
 * one that is not recognised: the reader refuses those.
 */
void file_expect(const char *path, unsigned int expected);

/*
 * The same for an operand, which may lack the extension of its kind: returns "liver.rec" of
 * "liver" if only that exists, else @path. Lives as long as the program.
 */
const char *file_operand(const char *path, enum file_kind expected);

#endif
