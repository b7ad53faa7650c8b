"""The live report: what a page needs of an impact or a map so that it can be struck anew there."""
