/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * liblsl of the Lab Streaming Layer, opened at run time: Debian has no package of it. The
 * functions and their types follow its documented C interface, of version 1.13 and later.
 */
#ifndef INCISE_LIBLSL_H
#define INCISE_LIBLSL_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>

typedef struct lsl_streaminfo_struct_ *lsl_streaminfo;
typedef struct lsl_inlet_struct_ *lsl_inlet;
typedef struct lsl_outlet_struct_ *lsl_outlet;
typedef struct lsl_xml_ptr_struct_ *lsl_xml;

/* Formats of channels, and errors, with the numbers of the interface. */
enum { LSL_FLOAT32 = 1, LSL_DOUBLE64 = 2, LSL_STRING = 3 };
enum { LSL_TIMEOUT = -1, LSL_LOST = -2 };

/* Name, return type, arguments. */
#define LIBLSL_FUNCTIONS(X)                                                             \
	X(lsl_local_clock, double, (void))                                              \
	X(lsl_resolve_all, int32_t, (lsl_streaminfo *, uint32_t, double))               \
	X(lsl_resolve_byprop, int32_t,                                                  \
	  (lsl_streaminfo *, uint32_t, const char *, const char *, int32_t, double))    \
	X(lsl_create_streaminfo, lsl_streaminfo,                                        \
	  (const char *, const char *, int32_t, double, int32_t, const char *))         \
	X(lsl_destroy_streaminfo, void, (lsl_streaminfo))                               \
	X(lsl_get_name, const char *, (lsl_streaminfo))                                 \
	X(lsl_get_type, const char *, (lsl_streaminfo))                                 \
	X(lsl_get_hostname, const char *, (lsl_streaminfo))                             \
	X(lsl_get_channel_count, int32_t, (lsl_streaminfo))                             \
	X(lsl_get_nominal_srate, double, (lsl_streaminfo))                              \
	X(lsl_get_channel_format, int32_t, (lsl_streaminfo))                            \
	X(lsl_get_desc, lsl_xml, (lsl_streaminfo))                                      \
	X(lsl_child, lsl_xml, (lsl_xml, const char *))                                  \
	X(lsl_next_sibling_n, lsl_xml, (lsl_xml, const char *))                         \
	X(lsl_empty, int32_t, (lsl_xml))                                                \
	X(lsl_child_value_n, const char *, (lsl_xml, const char *))                     \
	X(lsl_append_child, lsl_xml, (lsl_xml, const char *))                           \
	X(lsl_append_child_value, lsl_xml, (lsl_xml, const char *, const char *))       \
	X(lsl_create_inlet, lsl_inlet, (lsl_streaminfo, int32_t, int32_t, int32_t))     \
	X(lsl_destroy_inlet, void, (lsl_inlet))                                         \
	X(lsl_get_fullinfo, lsl_streaminfo, (lsl_inlet, double, int32_t *))             \
	X(lsl_open_stream, void, (lsl_inlet, double, int32_t *))                        \
	X(lsl_time_correction_ex, double,                                               \
	  (lsl_inlet, double *, double *, double, int32_t *))                           \
	X(lsl_pull_chunk_d, unsigned long,                                              \
	  (lsl_inlet, double *, double *, unsigned long, unsigned long, double,         \
	   int32_t *))                                                                  \
	X(lsl_create_outlet, lsl_outlet, (lsl_streaminfo, int32_t, int32_t))            \
	X(lsl_destroy_outlet, void, (lsl_outlet))                                       \
	X(lsl_push_sample_dtp, int32_t, (lsl_outlet, const double *, double, int32_t))  \
	X(lsl_push_sample_strtp, int32_t, (lsl_outlet, const char **, double, int32_t)) \
	X(lsl_have_consumers, int32_t, (lsl_outlet))

struct liblsl {
	void *handle;
#define LIBLSL_MEMBER(name, type, arguments) type(*name) arguments;
	LIBLSL_FUNCTIONS(LIBLSL_MEMBER)
#undef LIBLSL_MEMBER
};

/*
 * Open PYLSL_LIB of the environment, else liblsl.so.2, else liblsl.so, and never close it: its
 * threads outlive their work. Unless a configuration of LSL is there, its messages on stderr are
 * turned off but for fatal errors: the callers' errors tell the user enough. 0, -ENOENT (no
 * library), -ENOEXEC (it lacks a function).
 */
int liblsl_open(struct liblsl *lsl, const char *where, struct incise_error *err);

#endif
