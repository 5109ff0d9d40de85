/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The formats of exports: the one place where they are listed. Choosing by the extension, the commands with their
 * help, and the kinds of files are made of it. The first one is that of any other extension.
 *
 *   FORMAT(id, name, extensions, magic, lineage)   incise_table_ID is in a file of this folder
 *   MODULE(… the same …)                           it is in the module export_ID.so
 *     magic    first bytes of a file; "": none
 *     lineage  its provenance is there ALWAYS, or by CHOICE
 */
#ifndef INCISE_FORMATS_H
#define INCISE_FORMATS_H

/* They hold rows of any recordings. */
#define INCISE_FORMATS_OF_ROWS(FORMAT, MODULE) \
	FORMAT(csv, "CSV", ".csv", "", CHOICE) \
	MODULE(hdf5, "HDF5", ".h5 .hdf5", "\x89HDF\r\n\x1a\n", ALWAYS)

/* They hold messages: all rows of one recording. */
#define INCISE_FORMATS_OF_MESSAGES(FORMAT, MODULE) \
	FORMAT(mcap, "MCAP", ".mcap", "\x89MCAP0\r\n", ALWAYS)

#define INCISE_FORMATS(FORMAT, MODULE)         \
	INCISE_FORMATS_OF_ROWS(FORMAT, MODULE) \
	INCISE_FORMATS_OF_MESSAGES(FORMAT, MODULE)

/* Their extensions, with a space before each. */
#define INCISE_FORMAT_EXTENSIONS(id, name, extensions, ...) " " extensions
#define INCISE_ROW_EXTENSIONS \
	INCISE_FORMATS_OF_ROWS(INCISE_FORMAT_EXTENSIONS, INCISE_FORMAT_EXTENSIONS)
#define INCISE_MESSAGE_EXTENSIONS \
	INCISE_FORMATS_OF_MESSAGES(INCISE_FORMAT_EXTENSIONS, INCISE_FORMAT_EXTENSIONS)

#endif
