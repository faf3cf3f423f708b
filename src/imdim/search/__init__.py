"""Structure search: boolean programs over canonical candidates; the product's search by signed sequences is `structure`."""
