/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * Macros that every public header uses: C++ linkage, visibility, printf checking.
 *
 * Conventions of the whole library, not repeated at each function:
 *
 *  - Lengths are millimetres, forces newtons, times seconds in double or nanoseconds of
 *    CLOCK_MONOTONIC in int64_t.
 *  - A function returns 0 or a negative errno, or a pointer and NULL with errno set.
 *  - `struct incise_error *err` may be NULL. Otherwise a failing call writes one line there:
 *    what is wrong, where, and what to do.
 *  - `_free` and `_close` accept NULL.
 *  - There is no global state. Different objects may be used from different threads; one
 *    object from one thread at a time. "Real-time safe" means: no allocation, no lock, no
 *    system call. INCISE_REALTIME declares it for clang 20 and later, which checks it at run
 *    time with -fsanitize=realtime and at compile time with -Wfunction-effects. Other
 *    compilers ignore it.
 */
#ifndef INCISE_EXPORT_H
#define INCISE_EXPORT_H

#ifdef __cplusplus
#define INCISE_BEGIN_DECLS extern "C" {
#define INCISE_END_DECLS }
#else
#define INCISE_BEGIN_DECLS /**< begin of C linkage in C++ */
#define INCISE_END_DECLS   /**< end of C linkage in C++ */
#endif

#if defined(__GNUC__)
#define INCISE_API __attribute__((visibility("default")))
#define INCISE_PRINTF(fmt, args) __attribute__((format(printf, fmt, args)))
#else
#define INCISE_API /**< exported by the shared object */
/** The compiler checks the arguments like those of printf(3). */
#define INCISE_PRINTF(fmt, args)
#endif

/*
 * Attribute of a function type; this form works in C and C++. Clang 19 knows it, and warns of each
 * definition that does not repeat it.
 */
#if defined(__clang__) && __clang_major__ > 19
#if __has_attribute(nonblocking)
#define INCISE_REALTIME __attribute__((nonblocking))
#endif
#endif
#ifndef INCISE_REALTIME
#define INCISE_REALTIME
#endif

#endif
