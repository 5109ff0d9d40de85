/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Numbers in files are written and read with a decimal point whatever locale the
 * program has set. The thread's locale is switched between begin and end.
 */
#ifndef INCISE_C_LOCALE_H
#define INCISE_C_LOCALE_H

#include <locale.h>

struct incise_c_locale {
	locale_t c, before;
};

static inline struct incise_c_locale incise_c_locale_begin(void)
{
	struct incise_c_locale l = {.c = newlocale(LC_NUMERIC_MASK, "C", NULL)};

	l.before = l.c ? uselocale(l.c) : NULL;
	return l;
}

static inline void incise_c_locale_end(struct incise_c_locale l)
{
	if (!l.c)
		return;
	uselocale(l.before);
	freelocale(l.c);
}

#endif
