/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The version of the library. The Makefile reads the number from here.
 */
#ifndef INCISE_VERSION_H
#define INCISE_VERSION_H

#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Version of the headers. */
#define INCISE_VERSION "0.2.0"

/**
 * Version of the library in use, which may differ from INCISE_VERSION.
 *
 * @return static string, never NULL. Thread-safe, real-time safe.
 */
INCISE_API const char *incise_version(void);

INCISE_END_DECLS
#endif
