/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * CRC32C, Castagnoli's polynomial, as in iSCSI (RFC 3720, appendix B.4) and ext4. It finds
 * every change of up to 32 bits in a row, and all but 2^-32 of the other changes. No key
 * is in it: it detects damage, not forgery.
 */
#ifndef INCISE_CRC32C_H
#define INCISE_CRC32C_H

#include <stddef.h>
#include <stdint.h>

/*
 * Go on with more bytes. @crc: of the bytes before, 0 without any; so that
 * crc32c(crc32c(0, a), b) is the CRC of a followed by b.
 */
uint32_t incise_crc32c(uint32_t crc, const void *bytes, size_t n);

/* The same in plain C, for processors without an instruction for it. */
uint32_t incise_crc32c_by_table(uint32_t crc, const void *bytes, size_t n);

#endif
