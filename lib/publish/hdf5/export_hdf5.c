// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The module that writes a table as HDF5: a dataset per column, since that is what
 * h5read('pairs.h5', '/force_N') and h5py's file['force_N'][:] take as it is.
 *
 *     /            attributes: the provenance
 *     /t_s         float64, attributes units, description; chunks of a block,
 *     /force_N     float32  shuffled and deflated; uncertainty_variables, if they are asked for
 *     /cut         int32, from 1, into
 *     /cut_names   texts of one length
 *
 * It writes the outfile's own inode, through /proc: nothing shows under the final name.
 *
 * Chunks are packed here, not by the library, whose deflate searches for repeated strings, which
 * single samples do not have. Runs of one byte, frequent in shuffled columns, and Huffman's code
 * take half the time and a quarter more space.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <hdf5.h>
#include <zlib.h>
#include "../table_writer.h"

#define LEVEL 1 /* noted in the file; readers ignore it */

struct hdf5 {
	hid_t file;
	hid_t *columns; /* datasets */
	void *narrow;	/* a block's column as it is stored, shuffled, packed */
	unsigned char *shuffled, *packed;
	size_t packed_size;
	z_stream deflate;
	bool deflates;
	bool failed; /* libhdf5 1.10 crashes in closing what it could not write */
};

/* The file stays open and without a name, until the process ends. */
static int fail_export_hdf5(struct hdf5 *hdf5, const char *what, struct incise_error *err)
{
	int code = errno ? errno : EIO;

	hdf5->failed = true;
	return incise_error_set(err, code,
				"HDF5: %s: %s; free disk space, or give "
				"another -o",
				what, strerror(code));
}

static int put_export_hdf5_text(hid_t at, const char *key, const char *value)
{
	hid_t type = H5Tcopy(H5T_C_S1), space = H5Screate(H5S_SCALAR);
	hid_t attribute;
	int rc;

	H5Tset_size(type, *value ? strlen(value) : 1);
	H5Tset_strpad(type, H5T_STR_NULLPAD);
	H5Tset_cset(type, H5T_CSET_UTF8);
	attribute = H5Acreate2(at, key, type, space, H5P_DEFAULT, H5P_DEFAULT);
	rc = attribute < 0 || H5Awrite(attribute, type, value) < 0 ? -1 : 0;
	if (attribute >= 0 && H5Aclose(attribute) < 0)
		rc = -1;
	H5Sclose(space);
	H5Tclose(type);
	return rc;
}

static hid_t stored_type(enum incise_column_type type)
{
	switch (type) {
	case INCISE_COLUMN_REAL:
	case INCISE_COLUMN_SEEN:
		return H5T_NATIVE_DOUBLE;
	case INCISE_COLUMN_SINGLE:
	case INCISE_COLUMN_COARSE:
		return H5T_NATIVE_FLOAT;
	case INCISE_COLUMN_FLAG:
		return H5T_NATIVE_UINT8;
	case INCISE_COLUMN_NAME:
		return H5T_NATIVE_INT32;
	default:
		return H5T_NATIVE_INT64;
	}
}

/* Uncertainties in the style of the CF conventions. */
static int put_uncertainties(hid_t set, const struct incise_table *table, int i)
{
	const struct incise_table_column *column = &table->columns[i];
	char *names = incise_column_uncertainties(table->columns, table->n_columns, i);
	int rc = 0;

	if (names)
		rc = put_export_hdf5_text(set, "uncertainty_variables", names);
	if (names && !rc)
		rc = put_export_hdf5_text(set, "ancillary_variables", names);
	free(names);
	if (!rc && column->of)
		rc = put_export_hdf5_text(set, "uncertainty_of", column->of);
	if (!rc && column->of)
		rc = put_export_hdf5_text(set, "correlation", column->correlation);
	return rc;
}

static hid_t make_column(hid_t file, const struct incise_table *table, int i)
{
	const struct incise_table_column *column = &table->columns[i];
	hsize_t none = 0, most = H5S_UNLIMITED, chunk = INCISE_TABLE_BLOCK;
	hid_t space = H5Screate_simple(1, &none, &most);
	hid_t how = H5Pcreate(H5P_DATASET_CREATE);
	hid_t set = -1;

	/* Without times, equal data give equal files. */
	if (H5Pset_chunk(how, 1, &chunk) >= 0 && H5Pset_shuffle(how) >= 0 &&
	    H5Pset_deflate(how, LEVEL) >= 0 && H5Pset_obj_track_times(how, 0) >= 0)
		set = H5Dcreate2(file, column->name, stored_type(column->type), space,
				 H5P_DEFAULT, how, H5P_DEFAULT);
	H5Pclose(how);
	H5Sclose(space);
	if (set >= 0 && !put_export_hdf5_text(set, "units", column->unit) &&
	    !put_export_hdf5_text(set, "description", column->about) &&
	    !put_uncertainties(set, table, i))
		return set;
	if (set >= 0)
		H5Dclose(set);
	return -1;
}

static void hdf5_close(struct incise_table *table)
{
	struct hdf5 *hdf5 = table->state;

	for (int i = 0; hdf5->columns && i < table->n_columns && !hdf5->failed; i++)
		if (hdf5->columns[i] >= 0)
			H5Dclose(hdf5->columns[i]);
	if (hdf5->file >= 0 && !hdf5->failed)
		H5Fclose(hdf5->file);
	free(hdf5->columns);
	free(hdf5->narrow);
	free(hdf5->shuffled);
	free(hdf5->packed);
	if (hdf5->deflates)
		deflateEnd(&hdf5->deflate);
	free(hdf5);
	table->state = NULL;
}

static int open_export_hdf5_file(struct incise_table *table, struct hdf5 *hdf5)
{
	hid_t access = H5Pcreate(H5P_FILE_ACCESS);
	char path[40];

	snprintf(path, sizeof(path), "/proc/self/fd/%d", fileno(table->out));
	errno = 0;
	/* An open dataset must not keep the file open. */
	H5Pset_fclose_degree(access, H5F_CLOSE_STRONG);
	/* The default driver resolves the link to its text, which is not a path. */
	H5Pset_fapl_stdio(access);
	hdf5->file = H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, access);
	H5Pclose(access);
	return hdf5->file < 0 ? -1 : 0;
}

static int begin_deflate(struct hdf5 *hdf5)
{
	size_t block = INCISE_TABLE_BLOCK * sizeof(union incise_cell);

	hdf5->deflates = deflateInit2(&hdf5->deflate, LEVEL, Z_DEFLATED, MAX_WBITS,
				      MAX_MEM_LEVEL, Z_RLE) == Z_OK;
	if (!hdf5->deflates)
		return -1;
	hdf5->packed_size = deflateBound(&hdf5->deflate, block);
	hdf5->shuffled = malloc(block);
	hdf5->packed = malloc(hdf5->packed_size);
	return hdf5->shuffled && hdf5->packed ? 0 : -1;
}

static int hdf5_open(struct incise_table *table, struct incise_error *err)
{
	struct hdf5 *hdf5;
	struct stat st;
	int bad;

	if (fstat(fileno(table->out), &st) || !S_ISREG(st.st_mode))
		return incise_error_set(err, ESPIPE,
					"HDF5 cannot be written to a pipe or a device; "
					"give -o FILE.h5");
	H5dont_atexit(); /* nothing is left to close at the program's end */
	H5Eset_auto2(H5E_DEFAULT, NULL, NULL);
	hdf5 = calloc(1, sizeof(*hdf5));
	if (!hdf5)
		return incise_error_set(err, ENOMEM, "HDF5: out of memory");
	table->state = hdf5;
	hdf5->file = -1;
	hdf5->columns = malloc(table->n_columns * sizeof(*hdf5->columns));
	hdf5->narrow = malloc(INCISE_TABLE_BLOCK * sizeof(union incise_cell));
	for (int i = 0; hdf5->columns && i < table->n_columns; i++)
		hdf5->columns[i] = -1;
	if (!hdf5->columns || !hdf5->narrow || begin_deflate(hdf5))
		return incise_error_set(err, ENOMEM, "HDF5: out of memory");
	bad = open_export_hdf5_file(table, hdf5);
	for (int i = 0; i < table->n_columns && !bad; i++) {
		hdf5->columns[i] = make_column(hdf5->file, table, i);
		bad = hdf5->columns[i] < 0;
	}
	for (int i = 0; table->provenance && i < table->provenance->n && !bad; i++)
		bad = put_export_hdf5_text(hdf5->file, table->provenance->items[i].key,
					   table->provenance->items[i].value);
	return bad ? fail_export_hdf5(hdf5, "the file cannot be started", err) : 0;
}

/* A column of the block as it is stored. */
static void narrow(const union incise_cell *cells, size_t n, enum incise_column_type type,
		   void *to)
{
	float *singles = to;
	int32_t *names = to;
	uint8_t *flags = to;

	switch (type) {
	case INCISE_COLUMN_SINGLE:
	case INCISE_COLUMN_COARSE:
		for (size_t i = 0; i < n; i++)
			singles[i] = cells[i].real;
		break;
	case INCISE_COLUMN_NAME:
		for (size_t i = 0; i < n; i++)
			names[i] = cells[i].integer;
		break;
	case INCISE_COLUMN_FLAG:
		for (size_t i = 0; i < n; i++)
			flags[i] = cells[i].integer != 0;
		break;
	default:
		memcpy(to, cells, n * sizeof(*cells));
	}
}

/* All first bytes of the column's cells, then all second ones, … */
static void shuffle(const unsigned char *cells, size_t width, unsigned char *to)
{
	for (size_t byte = 0; byte < width; byte++)
		for (size_t i = 0; i < INCISE_TABLE_BLOCK; i++)
			*to++ = cells[i * width + byte];
}

/* Write a chunk as the filters of make_column() would make it; the last one is padded with 0. */
static int put_chunk(struct hdf5 *hdf5, hid_t set, const union incise_cell *cells,
		     size_t n, hsize_t from, enum incise_column_type type)
{
	z_stream *z = &hdf5->deflate;
	size_t width = H5Tget_size(stored_type(type));

	memset(hdf5->narrow, 0, INCISE_TABLE_BLOCK * width);
	narrow(cells, n, type, hdf5->narrow);
	shuffle(hdf5->narrow, width, hdf5->shuffled);
	z->next_in = hdf5->shuffled;
	z->avail_in = INCISE_TABLE_BLOCK * width;
	z->next_out = hdf5->packed;
	z->avail_out = hdf5->packed_size;
	if (deflateReset(z) != Z_OK || deflate(z, Z_FINISH) != Z_STREAM_END)
		return -1;
	return H5Dwrite_chunk(set, H5P_DEFAULT, 0, &from, z->total_out, hdf5->packed) < 0
		       ? -1
		       : 0;
}

static int hdf5_put(struct incise_table *table, struct incise_error *err)
{
	struct hdf5 *hdf5 = table->state;
	hsize_t from = table->rows, end = from + table->filled;
	int bad = 0;

	errno = 0;
	for (int i = 0; i < table->n_columns && !bad; i++) {
		enum incise_column_type type = table->columns[i].type;

		bad = H5Dset_extent(hdf5->columns[i], &end) < 0 ||
		      put_chunk(hdf5, hdf5->columns[i],
				table->block + (size_t)i * INCISE_TABLE_STRIDE,
				table->filled, from, type);
	}
	return bad ? fail_export_hdf5(hdf5, "rows cannot be written", err) : 0;
}

/* Write the texts of a column of names. */
static int put_names(struct incise_table *table, const struct incise_table_column *column)
{
	struct hdf5 *hdf5 = table->state;
	hsize_t n = table->n_names;
	hid_t type = H5Tcopy(H5T_C_S1), space = H5Screate_simple(1, &n, NULL), set;
	size_t length = 1;
	char name[80], *texts;
	int rc = -1;

	for (int i = 0; i < table->n_names; i++)
		if (strlen(table->names[i]) > length)
			length = strlen(table->names[i]);
	texts = calloc(n ? n : 1, length);
	for (int i = 0; texts && i < table->n_names; i++)
		memcpy(texts + i * length, table->names[i], strlen(table->names[i]));
	snprintf(name, sizeof(name), "%s_names", column->name);
	H5Tset_size(type, length);
	H5Tset_strpad(type, H5T_STR_NULLPAD);
	H5Tset_cset(type, H5T_CSET_UTF8);
	set = H5Dcreate2(hdf5->file, name, type, space, H5P_DEFAULT, H5P_DEFAULT,
			 H5P_DEFAULT);
	if (texts && set >= 0)
		rc = H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, texts) < 0 ? -1
										   : 0;
	if (set >= 0)
		H5Dclose(set);
	H5Sclose(space);
	H5Tclose(type);
	free(texts);
	return rc;
}

static int hdf5_end(struct incise_table *table, struct incise_error *err)
{
	struct hdf5 *hdf5 = table->state;
	int bad = 0;

	errno = 0;
	for (int i = 0; i < table->n_columns && !bad; i++)
		if (table->columns[i].type == INCISE_COLUMN_NAME)
			bad = put_names(table, &table->columns[i]);
	for (int i = 0; i < table->n_columns && !bad; i++) {
		bad = H5Dclose(hdf5->columns[i]) < 0;
		hdf5->columns[i] = -1;
	}
	if (!bad && H5Fclose(hdf5->file) < 0)
		bad = 1;
	else if (!bad)
		hdf5->file = -1;
	return bad ? fail_export_hdf5(hdf5, "the file cannot be closed", err) : 0;
}

const struct incise_table_format incise_table_hdf5 = {
	.abi = INCISE_TABLE_ABI,
	.open = hdf5_open,
	.put = hdf5_put,
	.end = hdf5_end,
	.close = hdf5_close,
};
